// Guards an object that only one thread may use at a time.
#pragma once

#include <atomic>
#include <thread>

namespace torquer {

/// Any number of calls read the object, or one thread changes it. A change may call back: its
/// thread may then read the object within the change. A refused call throws `Thrown`.
template <class Thrown>
class Usage {
 public:
  /// Lock for the duration of a call.
  class Hold {
   public:
    Hold(const Hold&) = delete;
    Hold& operator=(const Hold&) = delete;
    ~Hold() {
      if (users_ == nullptr) return;
      if (changes_) {
        usage_.changer_ = std::thread::id();
        users_->store(0);
      } else {
        users_->fetch_sub(1);
      }
    }

   private:
    friend class Usage;
    Hold(Usage& usage, bool changes, bool counted)
        : usage_(usage), users_(counted ? &usage.users_ : nullptr), changes_(changes) {}

    Usage& usage_;
    std::atomic<int>* users_;  // null: within a change of the same thread
    bool changes_;
  };

  /// Lock for a call that only reads.
  [[nodiscard]] Hold Look() {
    int users = users_.load();
    while (users >= 0) {
      if (users_.compare_exchange_weak(users, users + 1)) return {*this, false, true};
    }
    if (!IsChanger()) RefuseOther();
    return {*this, false, false};
  }

  /// Lock for a call that moves the object.
  [[nodiscard]] Hold Change() {
    if (Take()) return {*this, true, true};
    if (IsChanger()) {
      throw Thrown("a step of this object is running; change the object after the step");
    }
    RefuseOther();
  }

  /// Lock for a call that writes other data than the motion; allowed within a change.
  [[nodiscard]] Hold Work() {
    if (Take()) return {*this, true, true};
    if (!IsChanger()) RefuseOther();
    return {*this, false, false};
  }

 private:
  bool Take() {
    int none = 0;
    if (!users_.compare_exchange_strong(none, -1)) return false;
    changer_ = std::this_thread::get_id();
    return true;
  }
  bool IsChanger() const { return changer_.load() == std::this_thread::get_id(); }
  [[noreturn]] static void RefuseOther() {
    throw Thrown(
        "another thread uses this object; use it from one thread at a time, or give each thread a "
        "copy");
  }

  std::atomic<int> users_ = 0;  // number of readers; -1: one changer
  std::atomic<std::thread::id> changer_;
};

}  // namespace torquer
