// Fuzz target for a recorded session, from its bytes to the report. Mutations of odd length get
// valid record boundaries again, so that the records' contents are tested.
#include "host/recorder/session_log.h"

#include <cstring>
#include <torquer_lcm/picture_t.hpp>

#include "host/recorder/screen_course.h"
#include "host/recorder/session_report.h"
#include "host/recorder/shape_thinner.h"
#include "host/simulator/jpeg_encoder.h"
#include "host/support/error.h"
#include "protocol/lcm_channels.h"
#include "tests/fuzz/target.h"
#include "tests/support/sample_messages.h"

namespace torquer::fuzz::session_log_target {
namespace {

constexpr std::size_t kHeaderBytes = 28;

void AppendNumber(Bytes& bytes, std::uint64_t value, int size) {
  for (int k = size - 1; k >= 0; --k) bytes.push_back(static_cast<std::uint8_t>(value >> 8 * k));
}

void AppendRecord(Bytes& log, int number, const std::string& channel, const Bytes& data) {
  AppendNumber(log, 0xEDA1DA01, 4);
  AppendNumber(log, static_cast<std::uint64_t>(number), 8);
  AppendNumber(log, 1'700'000'000'000'000 + 1000 * static_cast<std::uint64_t>(number), 8);
  AppendNumber(log, channel.size(), 4);
  AppendNumber(log, data.size(), 4);
  log.insert(log.end(), channel.begin(), channel.end());
  log.insert(log.end(), data.begin(), data.end());
}

std::string ChannelOf(const std::string& type) {
  if (type == "device_sample_t") return protocol::kDeviceSampleChannel;
  if (type == "instrument_command_t") return protocol::kInstrumentCommandChannel;
  if (type == "wire_state_t") return protocol::kWireStateChannel;
  if (type == "scene_description_t") return protocol::kSceneChannel;
  if (type == "readings_t") return protocol::kReadingsChannel;
  if (type == "health_t") return protocol::kHealthChannel;
  if (type == "hand_motion_t") return protocol::kEmulatorTruthChannel;
  if (type == "vital_signs_t") return protocol::kVitalSignsChannel;
  if (type == "picture_t") return protocol::kPictureChannel;
  return "OTHER";
}

std::vector<Bytes> Seeds() {
  Bytes once, twice;
  int number = 0;
  for (const auto& sample : test::SampleMessages()) {
    AppendRecord(once, number++, ChannelOf(sample.type), sample.bytes);
  }
  twice = once;
  for (const auto& sample : test::SampleMessages()) {
    AppendRecord(twice, number++, ChannelOf(sample.type), sample.bytes);
  }
  return {once, twice};
}

// Session of the seeds above with a valid picture, for each plane.
std::vector<Bytes> ScreenSeeds() {
  effects::ImageSource::Picture gray;
  gray.width = gray.height = 16;
  gray.gray.assign(16 * 16, 100);
  simulator::JpegEncoder encoder;
  torquer_lcm::picture_t picture{};
  picture.encoding = "jpeg";
  picture.data = encoder.Encode(gray, 10'000).bytes;
  picture.byte_count = static_cast<std::int32_t>(picture.data.size());
  Bytes bytes(static_cast<std::size_t>(picture.getEncodedSize()));
  picture.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  Bytes log;
  int number = 0;
  for (const auto& sample : test::SampleMessages()) {
    const bool is_picture = sample.type == "picture_t";
    AppendRecord(log, number++, ChannelOf(sample.type), is_picture ? bytes : sample.bytes);
  }
  AppendRecord(log, number++, protocol::kLateralPictureChannel, bytes);
  return {log};
}

bool Accepts(std::span<const std::uint8_t> input) {
  SessionReporter reporter;
  const SessionLogSummary summary = ReadSessionLog(FileWith(input), reporter.Handlers());
  summary.damage.Describe();
  try {
    const auto identity = [](const std::string&, int) {
      return Eigen::Matrix2d(Eigen::Matrix2d::Identity());
    };
    reporter.Finish(identity);
  } catch (const UserError&) {
    // A log without a required kind of message has no report.
  }
  return summary.undecodable == 0 && !summary.damage.any();
}

// Same log as torquer-recorder thins it and torquer-clip shows it.
bool AcceptsScreen(std::span<const std::uint8_t> input) {
  const std::string path = FileWith(input);
  ShapeThinner thinner(60);
  EventLogReader log(path);
  for (LogRecord record; log.Next(record);) thinner.Take(record.data, record.time_us);
  const ScreenCourse course(path);
  for (const std::int64_t time_us : {course.first_picture_us(), course.length_us()}) {
    const ScreenMoment moment = course.At(time_us);
    for (int plane = 0; plane < course.planes(); ++plane) {
      const std::int64_t picture = moment.planes[static_cast<std::size_t>(plane)].picture;
      if (picture >= 0) course.ReadPicture(plane, picture);
    }
  }
  return course.unusable() == 0;
}

std::uint32_t NumberAt(const Bytes& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < 4; ++k) value = value << 8 | bytes[at + k];
  return value;
}

// Makes the records contiguous, from the start as far as lengths allow.
void Repair(Bytes& input) {
  if (input.size() % 2 == 0) return;
  Bytes start;
  AppendNumber(start, 0xEDA1DA01, 4);
  for (std::size_t at = 0; at + kHeaderBytes <= input.size();) {
    std::copy(start.begin(), start.end(), input.begin() + static_cast<std::ptrdiff_t>(at));
    at += kHeaderBytes + std::size_t{NumberAt(input, at + 20)} + NumberAt(input, at + 24);
  }
}

const Registration kRegistration({.name = "session_log",
                                  .seeds = Seeds,
                                  .accepts = Accepts,
                                  .repair = Repair,
                                  .replay_inputs = 8000,
                                  .longest = 16384});

const Registration kScreen({.name = "session_screen",
                            .seeds = ScreenSeeds,
                            .accepts = AcceptsScreen,
                            .repair = Repair,
                            .replay_inputs = 4000,
                            .longest = 16384});

}  // namespace
}  // namespace torquer::fuzz::session_log_target
