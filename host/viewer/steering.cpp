#include "host/viewer/steering.h"

#include <algorithm>
#include <iterator>

#include "protocol/lcm_channels.h"

namespace torquer::viewer {

namespace {

// Gives a command its sender's next number, and the time.
template <class Command>
void Stamp(Command& command, std::int64_t clock_id, std::int64_t now_us) {
  command.sequence = protocol::NextSequence(command.sequence);
  command.clock_id = clock_id;
  command.publish_us = now_us;
}

}  // namespace

void Steering::Add(const torquer_lcm::scene_description_t& scene) {
  const bool same = std::equal(
      scene.instruments.begin(), scene.instruments.end(), commands_.begin(), commands_.end(),
      [](const auto& name, const auto& c) { return name == c.instrument; });
  if (same) return;
  commands_.assign(scene.instruments.size(), {});
  reach_.assign(scene.instruments.size(), {});
  for (std::size_t k = 0; k < commands_.size(); ++k) {
    commands_[k].instrument = scene.instruments[k];
    reach_[k] = {-scene.inserted_at_start_mm[k],
                 scene.max_length_mm[k] - scene.inserted_at_start_mm[k]};
  }
  placed_ = false;
}

void Steering::Add(const torquer_lcm::wire_state_t& state) {
  if (placed_ || commands_.empty() || state.instruments.size() != commands_.size()) return;
  for (std::size_t k = 0; k < commands_.size(); ++k) {
    const torquer_lcm::instrument_state_t& instrument = state.instruments[k];
    commands_[k].insertion_mm = instrument.commanded_insertion_mm - instrument.inserted_at_start_mm;
    commands_[k].rotation_rad = instrument.commanded_rotation_rad;
    commands_[k].sequence = std::max<std::int64_t>(instrument.command_sequence, 0);
  }
  placed_ = true;
}

void Steering::Add(const torquer_lcm::readings_t& readings) {
  if (table_moved_) return;
  for (std::size_t k = 0; k < readings.names.size(); ++k) {
    if (readings.names[k] == "table_left_mm") table_.left_mm = readings.values[k];
    if (readings.names[k] == "table_head_mm") table_.head_mm = readings.values[k];
    if (readings.names[k] == "table_height_mm") table_.height_mm = readings.values[k];
  }
}

void Steering::Restart() {
  commands_.clear();
  reach_.clear();
  placed_ = false;
  controls_ = {};
  table_motion_ = {};
  lao_rad_ = cra_rad_ = 0;
  table_ = {};
  table_moved_ = false;
  imaging_ = {};
  acquisition_ = {};
  chosen_ = wedges_moved_ = false;
  injector_ = {};
  injector_page_.reset();
  ordered_ = false;
  exchange_us_.reset();
}

void Steering::ChoosePlain() {
  imaging_.mode = effects::Imaging::Mode::kPlain;
  chosen_ = true;
}

bool Steering::Take(PageId page, const Controls& controls, std::int64_t now_us) {
  if (page_ && *page_ != page) return false;
  if (controls.instrument >= static_cast<int>(commands_.size())) return false;
  Advance(now_us);
  page_ = page;
  controls_ = controls;
  chosen_ = chosen_ || controls.acquisition;
  heard_us_ = now_us;
  return true;
}

bool Steering::Take(PageId page, const TableMotion& motion, std::int64_t now_us) {
  if (page_ != page) return false;
  Advance(now_us);
  table_motion_ = motion;
  return true;
}

bool Steering::Take(PageId page, const ImagingChoice& choice) {
  answered_[page] = choice.number;
  if (page_ && *page_ != page) return false;
  imaging_ = choice.imaging;
  acquisition_ = choice.acquisition;
  wedges_moved_ = wedges_moved_ || imaging_.wedges != effects::Imaging().wedges;
  chosen_ = true;
  return true;
}

bool Steering::Take(PageId page, const effects::Injector& injector) {
  const bool stops = injector_page_ == page && injector.order == effects::Injector::Order::kOff;
  if (page_ && *page_ != page && !stops) return false;
  injector_ = injector;
  injector_page_ = page;
  ordered_ = true;
  return true;
}

bool Steering::Take(PageId page, const ExchangeChoice& choice, std::int64_t now_us) {
  if (page_ && *page_ != page) return false;
  if (choice.instrument >= static_cast<int>(commands_.size())) return false;
  exchange_us_ = now_us;
  ++exchange_command_.order;
  exchange_command_.instrument = commands_[static_cast<std::size_t>(choice.instrument)].instrument;
  exchange_command_.device = choice.device;
  return true;
}

std::vector<std::uint32_t> Steering::AnsweredChoices() const {
  std::vector<std::uint32_t> numbers;
  for (const auto& [page, number] : answered_) numbers.push_back(number);
  return numbers;
}

const torquer_lcm::imaging_command_t* Steering::ImagingCommand(std::int64_t now_us) {
  if (!chosen_) return nullptr;
  torquer_lcm::imaging_command_t& command = imaging_command_;
  Stamp(command, clock_id_, now_us);
  command.mode = static_cast<std::int32_t>(acquires() ? acquisition_.mode : imaging_.mode);
  command.pulses_per_s = acquires() ? acquisition_.pulses_per_s : imaging_.pulses_per_s;
  command.magnification = imaging_.magnification;
  const double shutters[] = {imaging_.left, imaging_.right, imaging_.top, imaging_.bottom};
  std::copy(std::begin(shutters), std::end(shutters), std::begin(command.shutters));
  return &command;
}

const torquer_lcm::wedge_command_t* Steering::WedgeCommand(std::int64_t now_us) {
  if (!wedges_moved_) return nullptr;
  torquer_lcm::wedge_command_t& command = wedge_command_;
  Stamp(command, clock_id_, now_us);
  for (std::size_t k = 0; k < imaging_.wedges.size(); ++k) {
    command.share[k] = imaging_.wedges[k].share;
    command.rotation_deg[k] = imaging_.wedges[k].rotation_deg;
  }
  return &command;
}

const torquer_lcm::injector_command_t* Steering::InjectorCommand(std::int64_t now_us) {
  if (!ordered_) return nullptr;
  torquer_lcm::injector_command_t& command = injector_command_;
  Stamp(command, clock_id_, now_us);
  command.order = static_cast<std::int32_t>(injector_.order);
  command.volume_mL = injector_.volume_mL;
  command.rate_mL_s = injector_.rate_mL_s;
  command.delay_s = injector_.delay_s;
  command.rise_s = injector_.rise_s;
  return &command;
}

const torquer_lcm::exchange_command_t* Steering::ExchangeCommand(std::int64_t now_us) {
  if (!exchange_us_ || now_us - *exchange_us_ > kOrderUs) return nullptr;
  Stamp(exchange_command_, clock_id_, now_us);
  return &exchange_command_;
}

void Steering::Leave(PageId page) {
  answered_.erase(page);
  if (injector_page_ == page) {
    injector_.order = effects::Injector::Order::kOff;
    injector_page_.reset();
  }
  if (page_ != page) return;
  page_.reset();
  controls_ = {};
  table_motion_ = {};
}

const torquer_lcm::table_command_t* Steering::TableCommand(std::int64_t now_us, bool again) {
  torquer_lcm::table_command_t& command = table_command_;
  const effects::Table sent{command.left_mm, command.head_mm, command.height_mm};
  if (!table_moved_ || commands_.empty() || (!again && sent == table_)) return nullptr;
  command.instrument = commands_.front().instrument;
  Stamp(command, clock_id_, now_us);
  command.left_mm = table_.left_mm;
  command.head_mm = table_.head_mm;
  command.height_mm = table_.height_mm;
  return &command;
}

void Steering::MoveTable(double passed_s) {
  using effects::Table;
  const auto moved = [passed_s](double place_mm, double rate_mm_s, double most_mm) {
    return std::clamp(place_mm + rate_mm_s * passed_s, -most_mm, most_mm);
  };
  const Table to{moved(table_.left_mm, table_motion_.left_mm_s, Table::kMostLeftMm),
                 moved(table_.head_mm, table_motion_.head_mm_s, Table::kMostHeadMm),
                 moved(table_.height_mm, table_motion_.height_mm_s, Table::kMostHeightMm)};
  table_moved_ = table_moved_ || to != table_;
  table_ = to;
}

void Steering::Advance(std::int64_t now_us) {
  // A request ends when its message is too old, however late this function is called.
  const std::int64_t until_us = std::min(now_us, heard_us_ + kSilentUs);
  const double passed_s =
      1e-6 * static_cast<double>(std::max<std::int64_t>(until_us - advanced_us_, 0));
  advanced_us_ = now_us;
  if (page_ && placed_) {
    const auto k = static_cast<std::size_t>(controls_.instrument);
    torquer_lcm::instrument_command_t& command = commands_[k];
    command.insertion_mm = std::clamp(command.insertion_mm + controls_.push_mm_s * passed_s,
                                      reach_[k].least_mm, reach_[k].most_mm);
    command.rotation_rad += controls_.turn_rad_s * passed_s;
    lao_rad_ = std::clamp(lao_rad_ + controls_.lao_rad_s * passed_s, -kLaoLimitRad, kLaoLimitRad);
    cra_rad_ = std::clamp(cra_rad_ + controls_.cra_rad_s * passed_s, -kCraLimitRad, kCraLimitRad);
    MoveTable(passed_s);
  }
  if (now_us - heard_us_ >= kSilentUs) {
    controls_ = {};
    table_motion_ = {};
  }
  if (now_us - heard_us_ >= kReleaseUs) page_.reset();
}

const std::vector<torquer_lcm::instrument_command_t>& Steering::Commands(std::int64_t now_us) {
  static const std::vector<torquer_lcm::instrument_command_t> kNone;
  if (!placed_) return kNone;
  for (torquer_lcm::instrument_command_t& command : commands_) {
    Stamp(command, clock_id_, now_us);
    command.origin_us = now_us;
    command.lao_rad = lao_rad_;
    command.cra_rad = cra_rad_;
    command.xray = static_cast<std::int8_t>(xray());
    command.contrast = static_cast<std::int8_t>(controls_.contrast);
    command.flags = page_ ? 0 : protocol::kCommandNoDevice;
  }
  return commands_;
}

}  // namespace torquer::viewer
