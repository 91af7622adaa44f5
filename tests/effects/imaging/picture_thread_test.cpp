// Picture thread beside the ticks: the data that two threads share. ThreadSanitizer runs it too.
#include "host/simulator/picture_thread.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <optional>
#include <thread>
#include <torquer_lcm/health_t.hpp>
#include <torquer_lcm/picture_t.hpp>
#include <vector>

#include "host/simulator/effects/imaging/fluoroscopy.h"
#include "protocol/lcm_channels.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

using simulator::PictureThread;

// A wire that is fed, and its X-ray pictures of 64 x 64.
class Ticks {
 public:
  Ticks() {
    settings_.arm.width = settings_.arm.height = 64;
    fluoroscopy_.emplace(settings_, model_, nullptr, std::vector<const vessel::FieldMotion*>(),
                         std::vector<effects::Instrument>{{.name = "guidewire", .model = &model_}});
  }
  effects::Fluoroscopy& fluoroscopy() { return *fluoroscopy_; }
  double time_s() const { return time_s_; }

  /// Runs a tick as long as a picture interval; true if a picture was taken.
  bool Next() {
    time_s_ += 1 / settings_.pictures_per_s;
    height_mm_ += 0.1;
    state_ = LayStraight(MakeWire({.sheath = {Vector3d(0, 0, height_mm_), Vector3d::UnitX()}}), 50);
    return fluoroscopy_->Take({.time_s = time_s_,
                               .step_s = 1 / settings_.pictures_per_s,
                               .controls = controls_,
                               .target = target_,
                               .state = state_,
                               .quadratic = quadratic_,
                               .report = report_});
  }

 private:
  effects::FluoroscopySettings settings_;
  WireModel model_ = MakeWire({});
  WireState state_ = LayStraight(model_, 50);
  effects::Controls controls_{.xray = true};
  InstrumentPoses target_;
  QuadraticModel quadratic_;
  TickReport report_;
  std::optional<effects::Fluoroscopy> fluoroscopy_;
  double time_s_ = 0;
  double height_mm_ = 0;
};

// Ticks, and the pictures that their thread has published.
struct PublishedPictures {
  Ticks ticks;
  bus::Bus bus{"memq://"};
  std::vector<torquer_lcm::picture_t> pictures;
  PictureThread thread{ticks.fluoroscopy(), bus, protocol::kPictureChannel};

  PublishedPictures() {
    bus.Subscribe<torquer_lcm::picture_t>(
        protocol::kPictureChannel,
        [this](const torquer_lcm::picture_t& picture) { pictures.push_back(picture); }, 0);
  }
};

TEST_CASE("Ticks never wait for pictures, and the newest of them is always shown") {
  PublishedPictures published;
  auto& [ticks, bus, pictures, thread] = published;
  const torquer_lcm::health_t health{};
  constexpr int kTicks = 300;
  for (int k = 0; k < kTicks; ++k) {
    REQUIRE(ticks.Next());
    thread.Offer();
    // Both threads publish.
    bus.Publish(protocol::kHealthChannel, health);
    bus.Handle(0);
    if (k % 10 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  const auto newest_is_shown = [&] {
    return !pictures.empty() && pictures.back().time_s == ticks.time_s();
  };
  for (int k = 0; k < 6000 && !newest_is_shown(); ++k) bus.Handle(10);
  REQUIRE(newest_is_shown());
  CHECK(thread.rendered() >= 1);
  CHECK(thread.rendered() <= kTicks);
  CHECK(pictures.back().number == thread.rendered() - 1);
  for (std::size_t k = 1; k < pictures.size(); ++k) {
    if (pictures[k].held != 0) continue;
    CHECK(pictures[k].number == pictures[k - 1].number + 1);
    CHECK(pictures[k].time_s > pictures[k - 1].time_s);
  }
}

TEST_CASE("A frame that was rendered before its offer arrives is not published twice") {
  PublishedPictures published;
  auto& [ticks, bus, pictures, thread] = published;
  // The first offer renders the second frame, whose own offer comes later.
  REQUIRE(ticks.Next());
  REQUIRE(ticks.Next());
  thread.Offer();
  for (int k = 0; k < 6000 && pictures.empty(); ++k) bus.Handle(10);
  REQUIRE(pictures.size() == 1);
  CHECK(pictures[0].time_s == ticks.time_s());
  thread.Offer();
  // A second picture would come within this time. A repeated one is marked as held.
  for (int k = 0; k < 30; ++k) bus.Handle(10);
  CHECK(thread.rendered() == 1);
  for (std::size_t k = 1; k < pictures.size(); ++k) CHECK(pictures[k].held != 0);
}

TEST_CASE("A paused picture thread renders nothing, and goes on with another source") {
  PublishedPictures published;
  auto& [ticks, bus, pictures, thread] = published;
  thread.Pause();
  REQUIRE(ticks.Next());
  thread.Offer();
  for (int k = 0; k < 20; ++k) bus.Handle(10);
  CHECK(pictures.empty());
  Ticks others;
  REQUIRE(others.Next());
  REQUIRE(others.Next());
  REQUIRE(others.time_s() != ticks.time_s());
  thread.Continue(others.fluoroscopy());
  for (int k = 0; k < 6000 && pictures.empty(); ++k) bus.Handle(10);
  REQUIRE_FALSE(pictures.empty());
  CHECK(pictures[0].time_s == others.time_s());
  thread.Pause();  // `others` ends before the thread
}

TEST_CASE("A picture thread ends at once, busy, offered or idle") {
  for (int k = 0; k < 20; ++k) {
    Ticks ticks;
    bus::Bus bus("memq://");
    PictureThread thread(ticks.fluoroscopy(), bus, protocol::kPictureChannel);
    if (k % 4 == 1) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    if (k % 2 == 1 && ticks.Next()) thread.Offer();
    if (k % 4 == 3) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

}  // namespace
}  // namespace torquer::test
