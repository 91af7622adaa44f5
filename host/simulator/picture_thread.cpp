#include "host/simulator/picture_thread.h"

#include <chrono>
#include <exception>
#include <torquer_lcm/picture_t.hpp>

#include "host/bus/clock.h"
#include "host/simulator/jpeg_encoder.h"
#include "host/support/error_output.h"
#include "host/support/realtime.h"

namespace torquer::simulator {

PictureThread::PictureThread(effects::ImageSource& source, bus::Bus& bus, const char* channel)
    : source_(&source), bus_(bus), channel_(channel), thread_([this] { RunUntilProblem(); }) {}

PictureThread::~PictureThread() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void PictureThread::Offer() {
  {
    const std::lock_guard lock(mutex_);
    offered_ = true;
  }
  wake_.notify_one();
}

void PictureThread::Pause() {
  std::unique_lock lock(mutex_);
  pauses_ = true;
  idle_.wait(lock, [this] { return !renders_; });
}

void PictureThread::Continue(effects::ImageSource& source) {
  {
    const std::lock_guard lock(mutex_);
    source_ = &source;
    pauses_ = false;
  }
  wake_.notify_one();
}

void PictureThread::RunUntilProblem() {
  LeaveRealtime();  // a picture takes longer than a tick
  try {
    Run();
  } catch (const std::exception& error) {
    PrintError("torquer-simulator: no more X-ray pictures ({}); the session goes on\n",
               error.what());
  }
}

// Ends the rendering also if it throws, so that Pause does not wait for ever.
bool PictureThread::Render(effects::ImageSource::Picture& picture) {
  struct End {
    PictureThread& of;
    ~End() {
      {
        const std::lock_guard lock(of.mutex_);
        of.renders_ = false;
      }
      of.idle_.notify_one();
    }
  };
  const End end{*this};
  return source_->Render(picture);
}

void PictureThread::Run() {
  constexpr std::chrono::seconds kRepeat{1};
  effects::ImageSource::Picture picture;
  JpegEncoder encoder;
  torquer_lcm::picture_t message{};
  message.clock_id = bus::ClockId();
  message.encoding = "jpeg";
  while (true) {
    bool fresh = false;
    {
      std::unique_lock lock(mutex_);
      wake_.wait_for(lock, kRepeat, [this] { return (offered_ && !pauses_) || stop_; });
      if (stop_) return;
      fresh = offered_ && !pauses_;
      if (fresh) offered_ = false;
      renders_ = fresh;
    }
    if (fresh) {
      const std::int64_t began_us = bus::MonotonicUs();
      // A frame that was rendered before its offer arrived is not published twice.
      if (!Render(picture)) continue;
      message.number = rendered_++;
      message.time_s = picture.time_s;
      message.lao_rad = picture.controls.lao_rad;
      message.cra_rad = picture.controls.cra_rad;
      const Jpeg& jpeg = encoder.Encode(picture, kMostPictureBytes);
      message.width = jpeg.width;
      message.height = jpeg.height;
      message.data = jpeg.bytes;
      message.byte_count = static_cast<std::int32_t>(message.data.size());
      last_us_ = bus::MonotonicUs() - began_us;
    }
    if (rendered_ == 0) continue;
    message.held = static_cast<std::int8_t>(!fresh);
    message.publish_us = bus::MonotonicUs();
    bus_.Publish(channel_, message);
  }
}

}  // namespace torquer::simulator
