// Event loop of one thread. It calls functions at times, and when files can be read.
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

/// If a called function throws, the loop ends, and Run() throws the exception.
class EventLoop {
 public:
  EventLoop() = default;
  ~EventLoop();
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;

  boost::asio::io_context& context() { return context_; }

  /// Calls `act` whenever the file can be read. The caller closes the file.
  void WhenReadable(int file_descriptor, std::function<void()> act);
  void Every(std::chrono::milliseconds interval, std::function<void()> act);

  /// Calls `act` at once, with the loop's handling of exceptions.
  template <class Act>
  void Guarded(Act&& act) {
    try {
      act();
    } catch (...) {
      problem_ = std::current_exception();
      Stop();
    }
  }

  /// Runs until Stop(), or until a function throws.
  void Run();
  void Stop() { context_.stop(); }

 private:
  std::exception_ptr problem_;
  boost::asio::io_context context_{1};
  std::vector<std::unique_ptr<boost::asio::posix::stream_descriptor>> watched_;
  std::vector<std::unique_ptr<boost::asio::steady_timer>> timers_;
};

}  // namespace torquer::viewer
