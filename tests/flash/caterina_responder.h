// Stand-in for a board in Caterina on a pseudo-terminal. It has the commands of AVR109 that avrdude
// uses, a flash, and a log of its operations.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace torquer::test {

class CaterinaResponder {
 public:
  static constexpr int kFlashBytes = 0x7000;
  static constexpr int kPageBytes = 128;

  CaterinaResponder();
  ~CaterinaResponder();
  CaterinaResponder(const CaterinaResponder&) = delete;
  CaterinaResponder& operator=(const CaterinaResponder&) = delete;

  /// Path that a program opens.
  const std::string& port() const { return port_; }
  /// After this many page writes it no longer answers, like a board without power.
  void FallSilentAfter(int writes) { silent_after_ = writes; }
  /// Flips a bit of this page when it is written.
  void SpoilPage(int page) { spoiled_page_ = page; }

  std::vector<std::uint8_t> flash() const;
  /// Operations: "erase", "write PAGE", "read PAGE" (the first of each run of pages read), "exit".
  std::vector<std::string> log() const;
  int writes() const { return writes_; }

 private:
  void Run();
  bool ReadByte(std::uint8_t* byte);
  void Answer(const std::vector<std::uint8_t>& bytes);
  void Obey(std::uint8_t command);
  void Block(bool write);
  void Log(const std::string& what);

  int controller_ = -1;
  int keep_open_ = -1;  // terminal side: prevents a hang-up between programs
  std::string port_;
  std::atomic<bool> stop_{false};
  std::atomic<int> silent_after_{-1};
  std::atomic<int> spoiled_page_{-1};
  std::atomic<int> writes_{0};
  mutable std::mutex mutex_;
  std::vector<std::uint8_t> flash_;
  std::vector<std::string> log_;
  int address_ = 0;  // in words
  std::thread thread_;
};

}  // namespace torquer::test
