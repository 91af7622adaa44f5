// A board in Caterina at the other end of a pseudo-terminal: AVR109 as far as avrdude speaks it,
// with a flash, and a log of what was done to it.
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

  /// What a program opens.
  const std::string& port() const { return port_; }
  /// Says nothing any more from this many page writes on, as a board that has lost its power.
  void FallSilentAfter(int writes) { silent_after_ = writes; }
  /// Spoils a bit of this page as it is written.
  void SpoilPage(int page) { spoiled_page_ = page; }

  std::vector<std::uint8_t> flash() const;
  /// "erase", "write PAGE", "read PAGE" (the first of each run of pages read), "exit".
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
  int keep_open_ = -1;  // the terminal's side, so that the line does not hang up between programs
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
