#include "host/simulator/live_commands.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "host/bus/clock.h"
#include "host/simulator/command_limits.h"
#include "host/support/printable_text.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

namespace {

constexpr std::int64_t kNameRefusalsEveryUs = 60'000'000;

// True if a sequence number equals or follows another one of the same sender. After the largest
// number the sequence restarts at zero (protocol::NextSequence). An equal number is a repeated
// command.
bool Follows(std::int64_t sequence, std::int64_t last) {
  const std::uint64_t ahead =
      (static_cast<std::uint64_t>(sequence) - static_cast<std::uint64_t>(last)) & INT64_MAX;
  return ahead < std::uint64_t{1} << 62;
}

// Text that names the first invalid values of a command; "" if all are valid.
std::string InvalidValues(const torquer_lcm::instrument_command_t& message,
                          const InstrumentPose& pose, const effects::Controls& controls) {
  if (!IsValid(pose)) {
    return fmt::format("insertion_mm {:g}, rotation_rad {:g}", message.insertion_mm,
                       message.rotation_rad);
  }
  if (!IsValid(controls)) {
    return fmt::format("lao_rad {:g}, cra_rad {:g}", message.lao_rad, message.cra_rad);
  }
  return "";
}

}  // namespace

LiveCommands::LiveCommands(const scene::Scene& scene)
    : scene_(scene),
      start_(scene.start()),
      clock_id_(bus::ClockId()),
      sources_(scene.instruments().size()) {
  command_.target = start_;
  const std::int64_t now_us = bus::MonotonicUs();
  for (Source& source : sources_) source.origin_us = now_us;
}

// Index of the instrument of a command; -1 if there is none of that name, which is reported.
int LiveCommands::FindInstrument(const std::string& name, const bus::Sender& sender,
                                 std::int64_t now_us) {
  const std::vector<effects::Instrument>& all = scene_.instruments();
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const auto& one) { return one.name == name; });
  if (found != all.end()) return static_cast<int>(found - all.begin());
  ++unknown_;
  SayUnknown(name, sender, now_us);
  return -1;
}

bool LiveCommands::Owns(const Source& source, std::int64_t now_us) const {
  return source.owner && now_us - source.heard_us < kOwnedUs;
}

void LiveCommands::Take(const torquer_lcm::instrument_command_t& message, const bus::Sender& sender,
                        std::int64_t now_us) {
  const int k = FindInstrument(message.instrument, sender, now_us);
  if (k < 0) return;
  const std::string& name = scene_.instruments()[static_cast<std::size_t>(k)].name;
  Source& source = sources_[static_cast<std::size_t>(k)];
  if (!Accepts(source, name, message.sequence, sender, now_us)) return;
  const InstrumentPose pose{start_[k].insertion_mm + message.insertion_mm, message.rotation_rad};
  const effects::Controls controls{message.lao_rad,           message.cra_rad,
                                   message.xray != 0,         message.contrast != 0,
                                   command_.controls.imaging, command_.controls.table,
                                   command_.controls.injector};
  const std::string invalid = InvalidValues(message, pose, controls);
  source.sequence = message.sequence;
  source.refused = !invalid.empty();
  fresh_ = true;
  if (source.refused) {
    Refuse(source, kValue, now_us,
           fmt::format(
               "a command for the {} from {} is refused, and the previous one remains valid: {}",
               name, bus::Describe(sender), invalid));
    Combine();
    return;
  }
  if (source.owner && (source.silent || sender != *source.owner)) {
    Say(fmt::format("the {} receives commands again, from {}", name, bus::Describe(sender)));
  }
  source.owner = sender;
  source.heard_us = now_us;
  source.silent = false;
  command_.target[k] = pose;
  if (k == 0) command_.controls = controls;
  // Missing times and times of another clock cannot be compared with ours.
  const auto is_valid_time = [&](std::int64_t time_us) {
    return message.clock_id == clock_id_ && time_us > 0 && time_us <= now_us;
  };
  source.origin_us = is_valid_time(message.origin_us) ? message.origin_us : now_us;
  sent_us_ = is_valid_time(message.publish_us) ? message.publish_us : 0;
  source.in_doubt = (message.flags & (protocol::kCommandLift | protocol::kCommandSensorFault |
                                      protocol::kCommandNoDevice)) != 0;
  Combine();
  ++taken_;
}

// Takes over a command that was not refused.
template <class Value>
void LiveCommands::Set(Source& source, const bus::Sender& sender, std::int64_t now_us,
                       const Value& wanted, Value& current) {
  source.owner = sender;
  source.heard_us = now_us;
  ++taken_;
  if (wanted == current) return;
  current = wanted;
  fresh_ = true;
  sent_us_ = 0;
}

void LiveCommands::Take(const torquer_lcm::imaging_command_t& message, const bus::Sender& sender,
                        std::int64_t now_us) {
  if (!Accepts(imaging_, "X-ray system", message.sequence, sender, now_us)) return;
  imaging_.sequence = message.sequence;
  effects::Imaging chosen;
  chosen.wedges = command_.controls.imaging.wedges;
  const bool known =
      message.mode >= protocol::kImagingAsScene && message.mode <= protocol::kImagingCine;
  if (known) chosen.mode = static_cast<effects::Imaging::Mode>(message.mode);
  chosen.pulses_per_s = message.pulses_per_s;
  chosen.magnification = message.magnification;
  chosen.left = message.shutters[0];
  chosen.right = message.shutters[1];
  chosen.top = message.shutters[2];
  chosen.bottom = message.shutters[3];
  if (!known || !IsValid(chosen)) {
    Refuse(
        imaging_, kValue, now_us,
        fmt::format(
            "a command for the X-ray system from {} is refused, and the previous one remains "
            "valid: mode {}, pulses_per_s {:g}, magnification {:g}, shutters {:g} {:g} {:g} {:g}",
            bus::Describe(sender), message.mode, message.pulses_per_s, message.magnification,
            message.shutters[0], message.shutters[1], message.shutters[2], message.shutters[3]));
    return;
  }
  Set(imaging_, sender, now_us, chosen, command_.controls.imaging);
}

void LiveCommands::Take(const torquer_lcm::wedge_command_t& message, const bus::Sender& sender,
                        std::int64_t now_us) {
  if (!Accepts(wedges_, "wedge filters", message.sequence, sender, now_us)) return;
  wedges_.sequence = message.sequence;
  effects::Imaging chosen = command_.controls.imaging;
  for (std::size_t k = 0; k < chosen.wedges.size(); ++k) {
    chosen.wedges[k] = {message.share[k], message.rotation_deg[k]};
  }
  if (!IsValid(chosen)) {
    Refuse(wedges_, kValue, now_us,
           fmt::format("a command for the wedge filters from {} is refused, and the previous one "
                       "remains valid: share {:g} {:g}, rotation_deg {:g} {:g}; give share 0 to "
                       "{:g}, rotation_deg {:g} to {:g}",
                       bus::Describe(sender), message.share[0], message.share[1],
                       message.rotation_deg[0], message.rotation_deg[1], effects::Wedge::kMostShare,
                       -effects::Wedge::kMostRotationDeg, effects::Wedge::kMostRotationDeg));
    return;
  }
  Set(wedges_, sender, now_us, chosen, command_.controls.imaging);
}

void LiveCommands::Take(const torquer_lcm::table_command_t& message, const bus::Sender& sender,
                        std::int64_t now_us) {
  if (message.instrument != scene_.instruments().front().name) return;
  if (!Accepts(table_, "table", message.sequence, sender, now_us)) return;
  table_.sequence = message.sequence;
  const effects::Table wanted{message.left_mm, message.head_mm, message.height_mm};
  if (!IsValid(wanted)) {
    Refuse(table_, kValue, now_us,
           fmt::format("a command for the table from {} is refused, and the previous one remains "
                       "valid: left_mm {:g}, head_mm {:g}, height_mm {:g}",
                       bus::Describe(sender), message.left_mm, message.head_mm, message.height_mm));
    return;
  }
  Set(table_, sender, now_us, wanted, command_.controls.table);
}

void LiveCommands::Take(const torquer_lcm::injector_command_t& message, const bus::Sender& sender,
                        std::int64_t now_us) {
  if (!Accepts(injector_, "power injector", message.sequence, sender, now_us)) return;
  injector_.sequence = message.sequence;
  using effects::Injector;
  const bool known =
      message.order >= protocol::kInjectorOff && message.order <= protocol::kInjectorInject;
  const Injector wanted{known ? static_cast<Injector::Order>(message.order) : Injector::Order::kOff,
                        message.volume_mL, message.rate_mL_s, message.delay_s, message.rise_s};
  const std::string invalid = known ? InvalidValue(wanted)
                                    : fmt::format("order {}; give {} to {}", message.order,
                                                  static_cast<int>(protocol::kInjectorOff),
                                                  static_cast<int>(protocol::kInjectorInject));
  if (!invalid.empty()) {
    Refuse(injector_, kValue, now_us,
           fmt::format("a command for the power injector from {} is refused, and the previous one "
                       "remains valid: {}",
                       bus::Describe(sender), invalid));
    return;
  }
  injector_.silent = false;
  Set(injector_, sender, now_us, wanted, command_.controls.injector);
}

void LiveCommands::Take(const torquer_lcm::exchange_command_t& message, const bus::Sender& sender,
                        std::int64_t now_us) {
  const int k = FindInstrument(message.instrument, sender, now_us);
  if (k < 0) return;
  if (!Accepts(exchanges_, "exchange of instruments", message.sequence, sender, now_us)) return;
  const bool repeats = exchanges_.owner == sender && message.order == exchange_number_;
  exchanges_.sequence = message.sequence;
  exchanges_.owner = sender;
  exchanges_.heard_us = now_us;
  exchange_number_ = message.order;
  ++taken_;
  if (!repeats) exchange_ = {k, message.device};
}

// True if the sender may command and the sequence number is in order; else reports the refusal.
bool LiveCommands::Accepts(Source& source, const std::string& what, std::int64_t sequence,
                           const bus::Sender& sender, std::int64_t now_us) {
  const bool owned = Owns(source, now_us);
  if (owned && sender != *source.owner) {
    Refuse(
        source, kSender, now_us,
        fmt::format("commands for the {} from {} are refused, because it receives commands from {}",
                    what, bus::Describe(sender), bus::Describe(*source.owner)));
    return false;
  }
  if (sequence < 0 || (owned && !Follows(sequence, source.sequence))) {
    Refuse(source, kOrder, now_us,
           fmt::format(
               "a command for the {} from {} is refused: its sequence number {} is not after {}",
               what, bus::Describe(sender), sequence, source.sequence));
    return false;
  }
  return true;
}

void LiveCommands::Age(std::int64_t now_us) {
  StopInjector(now_us);
  for (std::size_t k = 0; k < sources_.size(); ++k) {
    Source& source = sources_[k];
    if (!source.owner || source.silent || now_us - source.heard_us < kSilentUs) continue;
    source.silent = true;
    if (k == 0) command_.controls.xray = command_.controls.contrast = false;
    Combine();
    fresh_ = true;
    sent_us_ = 0;
    Say(fmt::format("commands for the {} from {} have stopped; it is held{}",
                    scene_.instruments()[k].name, bus::Describe(*source.owner),
                    k == 0 ? ", and the pedals are up" : ""));
  }
}

// A silent sender cannot stop an injection.
void LiveCommands::StopInjector(std::int64_t now_us) {
  Source& source = injector_;
  if (!source.owner || source.silent || now_us - source.heard_us < kSilentUs) return;
  source.silent = true;
  effects::Injector& injector = command_.controls.injector;
  if (injector.order == effects::Injector::Order::kOff) return;
  injector.order = effects::Injector::Order::kOff;
  fresh_ = true;
  sent_us_ = 0;
  Say(fmt::format("commands for the power injector from {} have stopped; it is off",
                  bus::Describe(*source.owner)));
}

void LiveCommands::Combine() {
  const auto any = [this](bool (*is)(const Source&)) {
    return std::any_of(sources_.begin(), sources_.end(), is);
  };
  command_.in_doubt = any([](const Source& s) { return s.in_doubt || s.silent; });
  command_.refused = any([](const Source& s) { return s.refused; });
}

void LiveCommands::Refuse(Source& source, Refusal kind, std::int64_t now_us,
                          const std::string& what) {
  ++refusals_[kind];
  std::int64_t& named_us = source.named_us[kind];
  if (named_us != 0 && now_us - named_us < kNameRefusalsEveryUs) return;
  named_us = now_us;
  Say(what);
}

// Reports only a few names a minute, because any sender can invent names.
void LiveCommands::SayUnknown(const std::string& instrument, const bus::Sender& sender,
                              std::int64_t now_us) {
  constexpr std::size_t kMostNames = 4;
  if (now_us - unknown_named_us_ >= kNameRefusalsEveryUs) {
    unknown_named_.clear();
    unknown_named_us_ = now_us;
  }
  if (unknown_named_.size() >= kMostNames || !unknown_named_.insert(instrument).second) return;
  std::string has;
  for (const effects::Instrument& one : scene_.instruments()) {
    has += (has.empty() ? "" : ", ") + one.name;
  }
  Say(fmt::format(
      "commands for '{}' from {} have no effect: the scene {} has no such instrument; it has {}",
      Printable(instrument, 40), bus::Describe(sender), scene_.name(), has));
}

void LiveCommands::Say(const std::string& what) { news_ += news_.empty() ? what : "; " + what; }

std::string LiveCommands::State() const {
  std::string missing;
  for (std::size_t k = 0; k < sources_.size(); ++k) {
    if (!sources_[k].silent) continue;
    missing += (missing.empty() ? "" : ", ") + scene_.instruments()[k].name;
  }
  return missing.empty() ? "running" : "no commands for " + missing;
}

std::string LiveCommands::TakeNews() { return std::exchange(news_, ""); }

bus::HealthCounters LiveCommands::Counters() const {
  return {{"commands", taken_},
          {"unknown_instrument", unknown_},
          {"refused_values", refusals_[kValue]},
          {"refused_senders", refusals_[kSender]},
          {"refused_order", refusals_[kOrder]}};
}

void LiveCommands::Describe(torquer_lcm::wire_state_t& out) const {
  for (std::size_t k = 0; k < sources_.size(); ++k) {
    out.instruments[k].command_sequence = sources_[k].sequence;
    out.instruments[k].origin_us = sources_[k].origin_us;
  }
}

}  // namespace torquer::simulator
