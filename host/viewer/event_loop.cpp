#include "host/viewer/event_loop.h"

#include <utility>

namespace torquer::viewer {

namespace asio = boost::asio;
using boost::system::error_code;

EventLoop::~EventLoop() {
  for (const auto& watched : watched_) watched->release();
}

void EventLoop::WhenReadable(int file_descriptor, std::function<void()> act) {
  auto& watched = *watched_.emplace_back(
      std::make_unique<asio::posix::stream_descriptor>(context_, file_descriptor));
  // The function starts itself again; its handler owns it.
  const auto wait = std::make_shared<std::function<void()>>();
  *wait = [this, &watched, act = std::move(act), again = std::weak_ptr(wait)] {
    watched.async_wait(asio::posix::stream_descriptor::wait_read,
                       [this, act, next = again.lock()](error_code error) {
                         if (error) return;
                         Guarded(act);
                         (*next)();
                       });
  };
  (*wait)();
}

void EventLoop::Every(std::chrono::milliseconds interval, std::function<void()> act) {
  auto& timer = *timers_.emplace_back(std::make_unique<asio::steady_timer>(context_));
  const auto wait = std::make_shared<std::function<void()>>();
  *wait = [this, &timer, interval, act = std::move(act), again = std::weak_ptr(wait)] {
    timer.expires_after(interval);
    timer.async_wait([this, act, next = again.lock()](error_code error) {
      if (error) return;
      Guarded(act);
      (*next)();
    });
  };
  (*wait)();
}

void EventLoop::Run() {
  context_.run();
  if (problem_) std::rethrow_exception(std::exchange(problem_, nullptr));
}

}  // namespace torquer::viewer
