// A loop of one thread that calls functions by time and when files can be read.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <exception>
#include <functional>
#include <memory>
#include <vector>

namespace torquer::viewer {

/// Functions that it calls may throw: the loop ends then, and Run() throws it.
class EventLoop {
 public:
  EventLoop() = default;
  ~EventLoop();
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;

  boost::asio::io_context& context() { return context_; }

  /// Calls `act` whenever the file can be read; it stays the caller's to close.
  void WhenReadable(int file_descriptor, std::function<void()> act);
  void Every(std::chrono::milliseconds interval, std::function<void()> act);

  /// Calls `act` at once, as the loop calls functions.
  template <class Act>
  void Guarded(Act&& act) {
    try {
      act();
    } catch (...) {
      problem_ = std::current_exception();
      Stop();
    }
  }

  /// Until Stop(), or what a function throws.
  void Run();
  void Stop() { context_.stop(); }

 private:
  std::exception_ptr problem_;
  boost::asio::io_context context_{1};
  std::vector<std::unique_ptr<boost::asio::posix::stream_descriptor>> watched_;
  std::vector<std::unique_ptr<boost::asio::steady_timer>> timers_;
};

}  // namespace torquer::viewer
