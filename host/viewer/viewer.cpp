#include "host/viewer/viewer.h"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <deque>
#include <future>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "host/bus/active_simulators.h"
#include "host/bus/clock.h"
#include "host/bus/health_reporter.h"
#include "host/support/error.h"
#include "host/support/printable_text.h"
#include "host/viewer/health_topics.h"
#include "host/viewer/page_messages.h"
#include "host/viewer/page_server.h"
#include "host/viewer/show_scene.h"
#include "host/viewer/steering.h"
#include "protocol/lcm_channels.h"

namespace torquer::viewer {
namespace {

// Period of commands. A page gets a state every second period, 62 per second.
constexpr std::chrono::milliseconds kLiveBeat{8};
// Messages kept between two readings of the bus, on which the simulator publishes at 1 kHz.
constexpr int kQueue = 64;
// Most commanded instruments: the bus may carry any name.
constexpr std::size_t kMostHands = 16;
constexpr std::int64_t kHandUs = 1'000'000;

class Viewer {
 public:
  Viewer(bus::Bus& bus, int listening_socket, const std::string& token, const ViewerSetup& setup,
         const std::atomic<bool>& stop)
      : bus_(bus),
        steer_(setup.steer),
        station_(setup.station),
        stop_(stop),
        health_(bus, "viewer"),
        steering_(bus::ClockId()),
        server_(
            listening_socket, token,
            [this](PageId page, std::span<const std::uint8_t> message) {
              return Take(page, message);
            },
            [this](PageId page) { steering_.Leave(page); }) {
    Subscribe();
    server_.ShowText("tray", TrayText());
    if (station_ != nullptr) {
      for (const Case& one : station_->cases()) {
        server_.Serve(PictureName(one), PageServer::ServedAs::kPicture, one.picture);
      }
      if (setup.start >= 0) StartCase(static_cast<std::size_t>(setup.start), false);
    }
    server_.WhenReadable(bus.FileDescriptor(), [this] { bus_.Handle(0); });
    server_.Every(kLiveBeat, [this] { Beat(); });
  }

  PageServer& server() { return server_; }

  void Run() {
    health_.Change("running", "", Counters());
    server_.Run();
    health_.Change("stopping", "", Counters());
  }

 private:
  void Subscribe() {
    bus_.SubscribeWithArrival<torquer_lcm::wire_state_t>(
        protocol::kWireStateChannel,
        [this](const torquer_lcm::wire_state_t& state, const bus::Arrival& arrival) {
          simulators_.State(arrival.sender, bus::MonotonicUs());
          steering_.Add(state);
          state_ = state;
          state_is_new_ = true;
          ++states_;
          if (station_ != nullptr) station_->SawState(bus::MonotonicUs());
        },
        kQueue);
    bus_.Subscribe<torquer_lcm::wire_forces_t>(
        protocol::kWireForcesChannel,
        [this](const torquer_lcm::wire_forces_t& forces) { forces_ = forces; }, kQueue);
    bus_.Subscribe<torquer_lcm::picture_t>(protocol::kPictureChannel,
                                           [this](const torquer_lcm::picture_t& picture) {
                                             server_.ShowBytes("picture", PictureFrame(picture));
                                           });
    bus_.Subscribe<torquer_lcm::picture_t>(
        protocol::kLateralPictureChannel, [this](const torquer_lcm::picture_t& picture) {
          server_.ShowBytes("picture/lateral", PictureFrame(picture, true));
        });
    bus_.SubscribeWithArrival<torquer_lcm::scene_description_t>(
        protocol::kSceneChannel,
        [this](const torquer_lcm::scene_description_t& scene, const bus::Arrival& arrival) {
          simulators_.Scene(arrival.sender, scene.name);
          steering_.Add(scene);
          for (const std::string& topic : health_topics_.Add(scene)) server_.Forget(topic);
          server_.ShowText("scene", SceneText(scene));
        });
    bus_.Subscribe<torquer_lcm::devices_t>(protocol::kDevicesChannel,
                                           [this](const torquer_lcm::devices_t& devices) {
                                             server_.ShowText("devices", DevicesText(devices));
                                           });
    bus_.Subscribe<torquer_lcm::readings_t>(protocol::kReadingsChannel,
                                            [this](const torquer_lcm::readings_t& readings) {
                                              steering_.Add(readings);
                                              server_.ShowText("readings", ReadingsText(readings));
                                            });
    bus_.Subscribe<torquer_lcm::vital_signs_t>(protocol::kVitalSignsChannel,
                                               [this](const torquer_lcm::vital_signs_t& vitals) {
                                                 server_.ShowText("patient", PatientText(vitals));
                                               });
    // A viewer that steers already knows its own commands.
    if (!steer_) {
      bus_.Subscribe<torquer_lcm::instrument_command_t>(
          protocol::kInstrumentCommandChannel,
          [this](const torquer_lcm::instrument_command_t& command) {
            if (!health_topics_.HasInstrument(command.instrument)) return;
            if (hands_.size() >= kMostHands && !hands_.contains(command.instrument)) hands_.clear();
            hands_[command.instrument] = {command.flags, bus::MonotonicUs()};
          },
          kQueue);
    }
    bus_.Subscribe<torquer_lcm::health_t>(protocol::kHealthChannel,
                                          [this](const torquer_lcm::health_t& health) {
                                            if (health.process == "viewer") return;
                                            const std::string topic = HealthTopics::TopicOf(health);
                                            if (health_topics_.Needs(health)) {
                                              server_.ShowText(topic, HealthText(health));
                                            } else {
                                              server_.ShowPassingText(topic, HealthText(health));
                                            }
                                          });
  }

  bool Take(PageId page, std::span<const std::uint8_t> message) {
    if (const auto choice = ReadImaging(message)) {
      if (steering_.Take(page, *choice)) PublishImaging(bus::MonotonicUs());
      return true;
    }
    if (const auto order = ReadInjector(message)) {
      if (steering_.Take(page, *order)) PublishInjector(bus::MonotonicUs());
      return true;
    }
    if (const auto choice = ReadExchange(message)) {
      const std::int64_t now_us = bus::MonotonicUs();
      if (steering_.Take(page, *choice, now_us)) PublishExchange(now_us);
      return true;
    }
    if (const auto control = ReadCaseControl(message)) {
      if (station_ == nullptr) return false;
      // While a page steers, no other page may change the case.
      if (steering_.page().value_or(page) == page) Take(*control);
      return true;
    }
    if (const auto motion = ReadTableMotion(message)) {
      if (steer_) steering_.Take(page, *motion, bus::MonotonicUs());
      return true;
    }
    const std::optional<Controls> controls = ReadControls(message);
    if (!controls) return false;
    if (steer_) steering_.Take(page, *controls, bus::MonotonicUs());
    return true;
  }

  void Take(const CaseControl& control) {
    switch (control.action) {
      case CaseControl::Action::kStart:
        StartCase(control.number, false);
        break;
      case CaseControl::Action::kExamine:
        StartCase(control.number, true);
        break;
      case CaseControl::Action::kEnd:
        station_->End(bus::MonotonicUs());
        break;
      case CaseControl::Action::kClose:
        station_->Close();
        break;
    }
  }

  static std::string PictureName(const Case& one) { return "cases/" + one.name + ".jpg"; }

  // Removes the previous case from the pages and from the steering.
  void StartCase(std::size_t number, bool examination) {
    if (!station_->Start(number, bus::MonotonicUs(), examination)) return;
    steering_.Restart();
    if (station_->chosen()->xray) steering_.ChoosePlain();
    state_.reset();
    forces_.reset();
    state_is_new_ = false;
    for (const char* topic : {"state", "picture", "picture/lateral", "readings", "patient", "scene",
                              "devices", "vessel", "lines"}) {
      server_.Forget(topic);
    }
    // An unfinished load continues, but its result is not shown.
    loads_.push_back(
        std::async(std::launch::async, [file = station_->chosen()->file]() -> SceneFrames {
          try {
            scene::Scene scene(file);
            return FramesOf(scene);
          } catch (const UserError&) {
            return {};  // the simulator reads the same file, and reports its error
          }
        }));
  }

  void AdvanceCase(std::int64_t now_us) {
    const bool changed = station_->Advance(now_us);
    if (changed) {
      server_.Serve("report.html", PageServer::ServedAs::kDocument,
                    station_->report() != nullptr ? *station_->report() : "");
      server_.ShowText("cases", station_->Text());
    }
    while (!loads_.empty() &&
           loads_.front().wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
      SceneFrames frames = loads_.front().get();
      // If several loads are pending, only the one that began last is shown.
      if (loads_.size() == 1 && !frames.vessel.empty()) ShowFrames(std::move(frames), server_);
      loads_.pop_front();
    }
  }

  void Beat() {
    if (stop_) return server_.Stop();
    const std::int64_t now_us = bus::MonotonicUs();
    if (station_ != nullptr) AdvanceCase(now_us);
    if (steer_) {
      steering_.Advance(now_us);
      // The settings of an acquisition arrive before its X-ray begins, and leave after it has
      // ended.
      const bool begins = steering_.acquires() && !acquires_;
      const bool ends = !steering_.acquires() && acquires_;
      acquires_ = steering_.acquires();
      if (begins) PublishImaging(now_us);
      for (const auto& command : steering_.Commands(now_us)) {
        bus_.Publish(protocol::kInstrumentCommandChannel, command);
      }
      if (ends) PublishImaging(now_us);
      PublishTable(now_us, false);
    }
    skip_ = !skip_;
    if (state_is_new_ && !skip_) {
      server_.ShowBytes("state",
                        StateFrame(*state_, forces_ ? &*forces_ : nullptr, bus::ClockId()));
      state_is_new_ = false;
    }
    if (now_us - summary_us_ >= kSummaryUs) Summarize(now_us);
    const std::string notice = bus_.TakeNotice(now_us);
    if (!notice.empty()) health_.Change("running", notice, Counters());
    if (health_.Due(now_us)) health_.Repeat(Counters());
  }

  void PublishImaging(std::int64_t now_us) {
    const torquer_lcm::imaging_command_t* const command = steering_.ImagingCommand(now_us);
    if (command != nullptr) bus_.Publish(protocol::kImagingCommandChannel, *command);
    const torquer_lcm::wedge_command_t* const wedges = steering_.WedgeCommand(now_us);
    if (wedges != nullptr) bus_.Publish(protocol::kWedgeCommandChannel, *wedges);
  }

  void PublishInjector(std::int64_t now_us) {
    const torquer_lcm::injector_command_t* const command = steering_.InjectorCommand(now_us);
    if (command != nullptr) bus_.Publish(protocol::kInjectorCommandChannel, *command);
  }

  void PublishExchange(std::int64_t now_us) {
    const torquer_lcm::exchange_command_t* const command = steering_.ExchangeCommand(now_us);
    if (command != nullptr) bus_.Publish(protocol::kExchangeCommandChannel, *command);
  }

  void PublishTable(std::int64_t now_us, bool again) {
    const torquer_lcm::table_command_t* const command = steering_.TableCommand(now_us, again);
    if (command != nullptr) bus_.Publish(protocol::kTableCommandChannel, *command);
  }

  // State of the devices that command instruments now, by the flags of their commands.
  nlohmann::json Hands(std::int64_t now_us) const {
    nlohmann::json hands = nlohmann::json::array();
    for (const auto& [instrument, hand] : hands_) {
      if (now_us - hand.heard_us > kHandUs) continue;
      const auto has = [flags = hand.flags](int flag) { return (flags & flag) != 0; };
      hands.push_back({{"instrument", Printable(instrument, 60)},
                       {"uncalibrated", has(protocol::kCommandUncalibrated)},
                       {"clutch", has(protocol::kCommandClutch)},
                       {"table", has(protocol::kCommandStickTable)},
                       {"height", has(protocol::kCommandStickHeight)},
                       {"lift", has(protocol::kCommandLift)},
                       {"fault", has(protocol::kCommandSensorFault)}});
    }
    return hands;
  }

  // Sends the viewer's own state to the page.
  void Summarize(std::int64_t now_us) {
    PublishImaging(now_us);
    PublishInjector(now_us);
    PublishExchange(now_us);
    PublishTable(now_us, true);
    const effects::Imaging& imaging = steering_.imaging();
    nlohmann::json wedges = nlohmann::json::array();
    for (const effects::Wedge& wedge : imaging.wedges) {
      wedges.push_back({{"share", wedge.share}, {"rotation_deg", wedge.rotation_deg}});
    }
    const double passed_s = 1e-6 * static_cast<double>(now_us - summary_us_);
    const auto page = steering_.page();
    server_.ShowText(
        "viewer",
        nlohmann::json({{"kind", "viewer"},
                        {"steer", steer_},
                        {"steered", page.has_value()},
                        {"page", page.value_or(0)},
                        {"lao_rad", steering_.lao_rad()},
                        {"cra_rad", steering_.cra_rad()},
                        {"xray", steering_.xray()},
                        {"acquires", steering_.acquires()},
                        {"acquisition",
                         {{"mode", static_cast<int>(steering_.acquisition().mode)},
                          {"pulses_per_s", steering_.acquisition().pulses_per_s}}},
                        {"contrast", steering_.contrast()},
                        {"mode", static_cast<int>(imaging.mode)},
                        {"pulses_per_s", imaging.pulses_per_s},
                        {"magnification", imaging.magnification},
                        {"shutters", {imaging.left, imaging.right, imaging.top, imaging.bottom}},
                        {"wedges", wedges},
                        {"answered", steering_.AnsweredChoices()},
                        {"hands", Hands(now_us)},
                        {"problem", simulators_.Conflict(now_us)},
                        {"states_per_s", states_ / passed_s}})
            .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
    states_ = 0;
    summary_us_ = now_us;
  }

  bus::HealthCounters Counters() const {
    return {{"pages", server_.pages()},
            {"refused", server_.refused()},
            {"undecodable", bus_.undecodable()},
            {"dropped", bus_.dropped()},
            {"publish_failures", bus_.publish_failures()}};
  }

  bus::Bus& bus_;
  const bool steer_;
  CaseStation* const station_;
  std::deque<std::future<SceneFrames>> loads_;
  const std::atomic<bool>& stop_;
  bus::HealthReporter health_;
  Steering steering_;
  HealthTopics health_topics_;
  bus::ActiveSimulators simulators_;
  std::optional<torquer_lcm::wire_state_t> state_;
  std::optional<torquer_lcm::wire_forces_t> forces_;
  struct Hand {
    std::int32_t flags = 0;  // of its newest command
    std::int64_t heard_us = 0;
  };
  std::map<std::string, Hand> hands_;  // by instrument
  bool state_is_new_ = false;
  bool skip_ = false;
  bool acquires_ = false;  // the pedal of the acquisition was down at the last beat
  int states_ = 0;
  std::int64_t summary_us_ = 0;
  PageServer server_;  // last member, because it calls the others
};

}  // namespace

void RunViewer(bus::Bus& bus, int listening_socket, const std::string& token,
               const ViewerSetup& setup, const std::atomic<bool>& stop) {
  Viewer viewer(bus, listening_socket, token, setup, stop);
  if (!setup.frames.vessel.empty()) ShowFrames(setup.frames, viewer.server());
  fmt::print("{}\n", viewer.server().url());
  std::fflush(stdout);
  viewer.Run();
}

}  // namespace torquer::viewer
