#include "host/recorder/screen_course.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "host/bus/message_check.h"
#include "host/recorder/find_reading.h"
#include "host/support/error.h"
#include "protocol/lcm_channels.h"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/picture_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/scene_description_t.hpp"

namespace torquer {
namespace {

constexpr const char* kRemedy = "give the file that torquer-recorder wrote";
// Timeout after which missing commands mean released pedals, as in the simulator.
constexpr std::int64_t kSilentUs = 300'000;

template <class Message>
bool Decode(std::span<const std::uint8_t> bytes, Message& message) {
  return bus::DecodeMessage(bytes.data(), bytes.size(), message);
}

std::optional<GrayPicture> Size(const torquer_lcm::picture_t& picture) {
  if (!std::isfinite(picture.lao_rad) || !std::isfinite(picture.cra_rad)) return {};
  return ReadGrayJpegSize({picture.data.data(), picture.data.size()});
}

// Last element of `all` that is not later than `time_us`; null if none.
template <class Timed>
const Timed* Newest(const std::vector<Timed>& all, std::int64_t time_us) {
  const auto after =
      std::upper_bound(all.begin(), all.end(), time_us,
                       [](std::int64_t at_us, const Timed& one) { return at_us < one.time_us; });
  return after == all.begin() ? nullptr : &*(after - 1);
}

}  // namespace

ScreenCourse::ScreenCourse(const std::string& path) : file_(path, kRemedy) {
  EventLogReader log(path);
  std::int64_t first_us = 0;
  bool begun = false;
  for (LogRecord record; log.Next(record);) {
    if (log.logs() > 1) continue;
    if (!begun) first_us = record.time_us;
    begun = true;
    // A wall clock may be set back, but record order is kept: time must not decrease.
    length_us_ = std::max(length_us_, ElapsedUs(first_us, record.time_us));
    if (!Take(record, length_us_)) ++unusable_;
  }
  log.RequireOneLog();
  damage_ = log.damage();
  if (!pedal_.empty() && length_us_ - commanded_us_ > kSilentUs) {
    Note(pedal_, commanded_us_ + kSilentUs, false);
  }
  if (pictures_[0].empty()) {
    throw UserError(path + ": holds no picture (channel " + protocol::kPictureChannel +
                    "); record a session whose scene has [effects.fluoroscopy]");
  }
}

void ScreenCourse::Note(std::vector<Change>& changes, std::int64_t time_us, bool on) {
  if (changes.empty() || changes.back().on != on) changes.push_back({time_us, on});
}

bool ScreenCourse::Take(const LogRecord& record, std::int64_t time_us) {
  if (record.channel == protocol::kPictureChannel) return TakePicture(record, time_us, 0);
  if (record.channel == protocol::kLateralPictureChannel) return TakePicture(record, time_us, 1);
  if (record.channel == protocol::kInstrumentCommandChannel) return TakeCommand(record, time_us);
  if (record.channel == protocol::kReadingsChannel) return TakeReadings(record, time_us);
  if (record.channel == protocol::kSceneChannel) return TakeScene(record, time_us);
  return true;
}

bool ScreenCourse::TakePicture(const LogRecord& record, std::int64_t time_us, int plane) {
  torquer_lcm::picture_t message;
  if (!Decode(record.data, message)) return false;
  const std::optional<GrayPicture> size = Size(message);
  if (!size) return false;
  std::vector<Picture>& pictures = pictures_[static_cast<std::size_t>(plane)];
  if (plane == 0) Note(live_, time_us, message.held == 0);
  const bool repeated = !pictures.empty() && pictures.back().number == message.number &&
                        pictures.back().taken_s == message.time_s;
  if (repeated) return true;
  width_ = std::max(width_, size->width);
  height_ = std::max(height_, size->height);
  pictures.push_back({.time_us = time_us,
                      .place = record.data_at,
                      .bytes = static_cast<std::uint32_t>(record.data.size()),
                      .number = message.number,
                      .taken_s = message.time_s,
                      .lao_rad = message.lao_rad,
                      .cra_rad = message.cra_rad});
  return true;
}

bool ScreenCourse::TakeCommand(const LogRecord& record, std::int64_t time_us) {
  torquer_lcm::instrument_command_t message;
  if (!Decode(record.data, message)) return false;
  if (!scenes_.empty() && message.instrument != scenes_.back().instrument) return true;
  if (!pedal_.empty() && time_us - commanded_us_ > kSilentUs) {
    Note(pedal_, commanded_us_ + kSilentUs, false);
  }
  Note(pedal_, time_us, message.xray != 0);
  commanded_us_ = time_us;
  return true;
}

bool ScreenCourse::TakeReadings(const LogRecord& record, std::int64_t time_us) {
  torquer_lcm::readings_t message;
  if (!Decode(record.data, message)) return false;
  readings_.push_back({.time_us = time_us,
                       .fluoroscopy_s = FindReading(message, "fluoroscopy_s"),
                       .air_kerma_mGy = FindOverPlanes(message, "air_kerma_mGy"),
                       .contrast_mL = FindReading(message, "contrast_injected_mL")});
  return true;
}

bool ScreenCourse::TakeScene(const LogRecord& record, std::int64_t time_us) {
  torquer_lcm::scene_description_t message;
  if (!Decode(record.data, message)) return false;
  const std::string instrument = message.instruments.empty() ? "" : message.instruments.front();
  if (scenes_.empty() || scenes_.back().name != message.name ||
      scenes_.back().instrument != instrument) {
    scenes_.push_back({time_us, message.name, instrument});
  }
  return true;
}

ScreenMoment ScreenCourse::At(std::int64_t time_us) const {
  ScreenMoment moment;
  for (std::size_t k = 0; k < pictures_.size(); ++k) {
    if (const Picture* picture = Newest(pictures_[k], time_us)) {
      moment.planes[k] = {picture - pictures_[k].data(), picture->lao_rad, picture->cra_rad};
    }
  }
  const Change* xray = Newest(pedal_.empty() ? live_ : pedal_, time_us);
  moment.xray = xray != nullptr && xray->on;
  if (const Readings* readings = Newest(readings_, time_us)) {
    moment.fluoroscopy_s = readings->fluoroscopy_s;
    moment.air_kerma_mGy = readings->air_kerma_mGy;
    moment.contrast_mL = readings->contrast_mL;
  }
  if (const Scene* scene = Newest(scenes_, time_us)) moment.scene = scene->name;
  return moment;
}

std::optional<GrayPicture> ScreenCourse::ReadPicture(int plane, std::int64_t picture) const {
  const Picture& found =
      pictures_.at(static_cast<std::size_t>(plane)).at(static_cast<std::size_t>(picture));
  std::vector<std::uint8_t> bytes(found.bytes);
  torquer_lcm::picture_t message;
  if (file_.ReadAt(found.place, bytes.data(), bytes.size()) != bytes.size() ||
      !Decode({bytes.data(), bytes.size()}, message)) {
    throw UserError(file_.path() + ": was changed while it was read; " + kRemedy);
  }
  return ReadGrayJpeg({message.data.data(), message.data.size()});
}

}  // namespace torquer
