#include "host/simulator/effects/observers/patient_monitor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "host/simulator/effects/motion/heartbeat.h"
#include "host/support/error.h"

namespace torquer::effects {

namespace {

constexpr double kSiteS = 0.02;   // interval between searches for the tip
constexpr double kEarlyS = 1e-6;  // rounding of times

}  // namespace

double EcgAt(double fraction) {
  struct Bell {
    double angle, slope, width;  // its height is slope * width^2
  };
  constexpr double kPi = std::numbers::pi;
  static constexpr Bell kBells[] = {{-kPi / 3, 1.2, 0.25},
                                    {-kPi / 12, -5, 0.1},
                                    {0, 30, 0.1},
                                    {kPi / 12, -7.5, 0.1},
                                    {kPi / 2, 0.75, 0.4}};
  const auto sum = [](double angle) {
    double all = 0;
    for (const Bell& bell : kBells) {
      const double away = std::remainder(angle - bell.angle, 2 * kPi) / bell.width;
      all += bell.slope * bell.width * bell.width * std::exp(-away * away / 2);
    }
    return all;
  };
  static const double peak = sum(0);
  return sum(2 * kPi * fraction) / peak;
}

PatientMonitor::PatientMonitor(const HeartCycle& heart, const PressureSite& site,
                               const VitalSigns::Limits& limits, const EffectContext& context)
    : heart_(heart),
      site_(site),
      instruments_(context.instruments),
      stack_(context.stack),
      moving_(context.moving) {
  memory_.vitals.limits = limits;
  Restart();
}

void PatientMonitor::Restart() {
  const VitalSigns::Limits limits = memory_.vitals.limits;
  memory_ = Memory();
  memory_.vitals.limits = limits;
  if (heart_.per_minute > 0) memory_.vitals.rate_per_min = heart_.per_minute;
  memory_.beat.is_whole = heart_.phase == 0;
  memory_.pressure_mmHg = VitalSigns::kUnknown;
  memory_.site_age_s = kSiteS;
  if (site_.flow != nullptr && !site_.instrument) SetSite(site_.place, site_.radius_mm);
}

// The instrument whose lumen holds the tip of another one and opens farthest; itself if none does.
int PatientMonitor::OutermostAround(int instrument, const TickView& tick) const {
  const InstrumentPoses& poses = tick.state.poses();
  int farthest = instrument;
  for (int k = instrument + 1; k < stack_->size(); ++k) {
    if (stack_->AreBeside(stack_->CurveOf(instrument), k)) continue;
    if (poses[k].insertion_mm > poses[farthest].insertion_mm) farthest = k;
  }
  return farthest;
}

void PatientMonitor::FindSite(const TickView& tick) {
  if (site_.flow == nullptr || !site_.instrument) return;
  memory_.site_age_s += tick.step_s;
  if (memory_.site_age_s < kSiteS - kEarlyS) return;
  memory_.site_age_s = 0;
  const int k = OutermostAround(*site_.instrument, tick);
  const double insertion_mm = tick.state.poses()[k].insertion_mm;
  memory_.has_site = insertion_mm > 0;
  memory_.vitals.wedged = false;
  if (!memory_.has_site) return;
  Eigen::Vector3d tip = PointAt(stack_->instrument(k), tick.state.CurveOf(k), insertion_mm);
  if (moving_ != nullptr) tip = moving_->AtRest(tip);
  SetSite(site_.flow->graph().network().NearestTo(tip),
          instruments_[static_cast<std::size_t>(k)].model->radius_mm(0));
}

void PatientMonitor::SetSite(const vessel::CenterlinePlace& place, double radius_mm) {
  const double filled = radius_mm / site_.flow->graph().network().At(place).radius_mm;
  memory_.has_site = true;
  memory_.vitals.wedged = filled * filled >= kClosingArea;
  memory_.site = site_.flow->PlaceOn(place);
}

void PatientMonitor::Observe(const TickView& tick) {
  FindSite(tick);
  while (static_cast<double>(memory_.vitals.samples) * VitalSigns::kSampleS <=
         tick.time_s + kEarlyS) {
    TakeSample(static_cast<double>(memory_.vitals.samples) * VitalSigns::kSampleS);
  }
  SetAlarms();
}

void PatientMonitor::TakeSample(double time_s) {
  VitalSigns& vitals = memory_.vitals;
  VitalSigns::Sample sample{.ecg = std::numeric_limits<float>::quiet_NaN()};
  if (heart_.per_minute > 0) {
    const double cycles = heart_.At(time_s);
    sample.ecg = static_cast<float>(EcgAt(cycles - std::floor(cycles)));
    const double beat_s = (std::floor(cycles + kEarlyS) - heart_.phase) * 60 / heart_.per_minute;
    if (beat_s >= 0) vitals.beat_s = beat_s;
  }
  const double pressure_mmHg = PressureAt(time_s);
  AddToBeat(time_s, pressure_mmHg);
  sample.pressure_mmHg = static_cast<float>(pressure_mmHg);
  vitals.kept[static_cast<std::size_t>(vitals.samples % VitalSigns::kKept)] = sample;
  ++vitals.samples;
}

double PatientMonitor::PressureAt(double time_s) {
  if (!memory_.has_site) return memory_.pressure_mmHg = VitalSigns::kUnknown;
  const Flow& flow = *site_.flow;
  if (!memory_.vitals.wedged || std::isnan(memory_.pressure_mmHg)) {
    return memory_.pressure_mmHg = flow.PressureAt(memory_.site, time_s - kEarlyS);
  }
  if (memory_.behind_version != flow.version() || memory_.behind_site.edge != memory_.site.edge) {
    memory_.behind = flow.PressureBehind(memory_.site);
    memory_.behind_version = flow.version();
    memory_.behind_site = memory_.site;
  }
  static const double share = 1 - std::exp(-VitalSigns::kSampleS / kSettlingS);
  const double behind_mmHg =
      memory_.behind.mmHg + flow.pulse().Ejection(time_s) * memory_.behind.muscle_mmHg;
  return memory_.pressure_mmHg += share * (behind_mmHg - memory_.pressure_mmHg);
}

// Without a heart, a second takes the place of a beat.
void PatientMonitor::AddToBeat(double time_s, double pressure_mmHg) {
  Beat& beat = memory_.beat;
  const double cycles = heart_.per_minute > 0 ? heart_.At(time_s) : time_s;
  const auto number = static_cast<std::int64_t>(std::floor(cycles + kEarlyS));
  if (number != beat.number) {
    VitalSigns& vitals = memory_.vitals;
    if (beat.is_whole && beat.samples > 0) {
      vitals.systolic_mmHg = beat.highest_mmHg;
      vitals.diastolic_mmHg = beat.lowest_mmHg;
      vitals.mean_mmHg = beat.sum_mmHg / beat.samples;
    }
    beat = {.number = number, .is_whole = true};
  }
  if (beat.samples == 0) beat.highest_mmHg = beat.lowest_mmHg = pressure_mmHg;
  ++beat.samples;
  beat.sum_mmHg += pressure_mmHg;
  // An unknown pressure makes the figures of its beat unknown.
  const bool is_known = !std::isnan(beat.sum_mmHg);
  beat.highest_mmHg = is_known ? std::max(beat.highest_mmHg, pressure_mmHg) : VitalSigns::kUnknown;
  beat.lowest_mmHg = is_known ? std::min(beat.lowest_mmHg, pressure_mmHg) : VitalSigns::kUnknown;
}

// A comparison with an unknown figure is false.
void PatientMonitor::SetAlarms() {
  VitalSigns& vitals = memory_.vitals;
  const VitalSigns::Limits& limits = vitals.limits;
  vitals.alarms = (vitals.rate_per_min < limits.rate_low_per_min ? kRateLow : 0) |
                  (vitals.rate_per_min > limits.rate_high_per_min ? kRateHigh : 0) |
                  (vitals.systolic_mmHg < limits.systolic_low_mmHg ? kSystolicLow : 0) |
                  (vitals.systolic_mmHg > limits.systolic_high_mmHg ? kSystolicHigh : 0) |
                  (vitals.wedged ? kPressureDamped : 0);
}

std::vector<Reading> PatientMonitor::Readings() const {
  const VitalSigns& vitals = memory_.vitals;
  const double wedged = vitals.wedged ? 1 : 0;
  return {{"heart_rate_per_min", vitals.rate_per_min},
          {"pressure_mmHg", memory_.pressure_mmHg},
          {"pressure_systolic_mmHg", vitals.systolic_mmHg},
          {"pressure_diastolic_mmHg", vitals.diastolic_mmHg},
          {"pressure_mean_mmHg", vitals.mean_mmHg},
          {"pressure_wedged", memory_.has_site ? wedged : VitalSigns::kUnknown},
          {"patient_alarms", static_cast<double>(vitals.alarms)}};
}

namespace {

enum class MeasuredAt { kTip, kEntry, kPlace };

struct MonitorSpec : TableSpec {
  MeasuredAt at = MeasuredAt::kTip;
  std::optional<std::string> instrument;
  std::optional<std::string> centerline;
  std::optional<double> at_mm;
  std::optional<double> catheter_radius_mm;
  double rate_low_per_min = VitalSigns::Limits().rate_low_per_min;
  double rate_high_per_min = VitalSigns::Limits().rate_high_per_min;
  double systolic_low_mmHg = VitalSigns::Limits().systolic_low_mmHg;
  double systolic_high_mmHg = VitalSigns::Limits().systolic_high_mmHg;
};

void Check(const MonitorSpec& spec, StrictTable& table) {
  const MeasuredAt at = spec.at;
  for (const char* key : {"centerline", "at_mm"}) {
    if (table.Has(key) == (at == MeasuredAt::kPlace)) continue;
    table.Refuse(key, at == MeasuredAt::kPlace
                          ? "is missing; at = \"place\" needs it"
                          : "is valid only with at = \"place\"; set that, or remove this key");
  }
  if (spec.instrument && at != MeasuredAt::kTip) {
    table.Refuse("instrument", "is valid only with at = \"tip\"; set that, or remove this key");
  }
  if (spec.catheter_radius_mm && at == MeasuredAt::kTip) {
    table.Refuse("catheter_radius_mm",
                 "is valid only with at = \"entry\" or \"place\"; an instrument has its own "
                 "radius; remove this key");
  }
  if (!(spec.rate_low_per_min < spec.rate_high_per_min)) {
    table.Refuse("rate_low_per_min", "must be less than rate_high_per_min");
  }
  if (!(spec.systolic_low_mmHg < spec.systolic_high_mmHg)) {
    table.Refuse("systolic_low_mmHg", "must be less than systolic_high_mmHg");
  }
}

const Keys<MonitorSpec>& MonitorKeys() {
  static const Keys<MonitorSpec> keys =
      Keys<MonitorSpec>()
          .Choice("at", &MonitorSpec::at, {"tip", "entry", "place"},
                  "place of the pressure: the tip of an instrument, the sheath at the entry (the "
                  "mouth of a catheter that is not simulated), or a place on a centerline")
          .Otherwise("the innermost instrument with a lumen")
          .Text("instrument", &MonitorSpec::instrument,
                "instrument at whose tip the pressure is measured, for at = \"tip\"; a solid one "
                "is a wire with a sensor")
          .Otherwise("unset: at is not \"place\"")
          .Text("centerline", &MonitorSpec::centerline,
                "centerline of the pressure, for at = \"place\"")
          .Otherwise("unset: at is not \"place\"")
          .Number("at_mm", &MonitorSpec::at_mm, 0, 1e5, "mm",
                  "arc length of the pressure along its centerline, for at = \"place\"")
          .Otherwise("0: that catheter closes no lumen")
          .Number("catheter_radius_mm", &MonitorSpec::catheter_radius_mm, 0, 20, "mm",
                  "outer radius of the catheter at the entry or the place; from 95 % of the "
                  "lumen's area on, it closes the lumen")
          .Number("rate_low_per_min", &MonitorSpec::rate_low_per_min, 0, 300, "1/min",
                  "alarm below this heart rate")
          .Number("rate_high_per_min", &MonitorSpec::rate_high_per_min, 0, 300, "1/min",
                  "alarm above this heart rate")
          .Number("systolic_low_mmHg", &MonitorSpec::systolic_low_mmHg, -50, 500, "mmHg",
                  "alarm below this systolic pressure")
          .Number("systolic_high_mmHg", &MonitorSpec::systolic_high_mmHg, -50, 500, "mmHg",
                  "alarm above this systolic pressure")
          .Checked(Check)
          .Example(
              "at = \"tip\"\n"
              "instrument = \"catheter\"\n"
              "systolic_high_mmHg = 180\n");
  return keys;
}

// The heartbeat and the flow must agree, because one ECG shows both.
HeartCycle FindHeart(const MonitorSpec& spec, const EffectContext& context) {
  HeartCycle heart;
  const auto* const flow = FindEarlier<Flow>(context);
  const auto* const beat = FindEarlier<Heartbeat>(context);
  if (flow == nullptr && beat == nullptr) {
    spec.origin.Refuse("at",
                       "the monitor has nothing to show: it needs [effects.flow] or "
                       "[effects.heartbeat]; add one of them, or remove [effects.patient_monitor]");
  }
  if (flow != nullptr) heart.per_minute = flow->pulse().per_minute;
  if (beat == nullptr) return heart;
  const double beats_per_min = 60 / beat->settings().period_s;
  const double phase = beat->settings().phase;
  constexpr double kSame = 1e-9;
  if (heart.per_minute > 0 &&
      (std::abs(heart.per_minute - beats_per_min) > kSame * beats_per_min || phase != 0)) {
    spec.origin.Refuse(
        "at", fmt::format("one ECG cannot show two hearts: [effects.flow] has {:.4g} beats a "
                          "minute from phase 0, [effects.heartbeat] {:.4g} from phase {:.4g}; "
                          "give both the same rate_per_min, and no phase",
                          heart.per_minute, beats_per_min, phase));
  }
  return {.per_minute = beats_per_min, .phase = phase};
}

PressureSite FindPressureSite(const MonitorSpec& spec, const EffectContext& context) {
  PressureSite site;
  site.flow = FindEarlier<Flow>(context);
  if (site.flow == nullptr) {
    if (spec.at != MeasuredAt::kTip || spec.instrument) {
      spec.origin.Refuse(spec.instrument ? "instrument" : "at",
                         "a pressure needs [effects.flow], which this scene does not have; add "
                         "it, or remove this key");
    }
    return site;
  }
  site.radius_mm = spec.catheter_radius_mm.value_or(0);
  const vessel::CenterlineNetwork& network = site.flow->graph().network();
  switch (spec.at) {
    case MeasuredAt::kEntry:
      site.place = network.NearestTo(context.wire.sheath().point_mm);
      return site;
    case MeasuredAt::kPlace:
      try {
        site.place = network.Place(*spec.centerline, *spec.at_mm);
      } catch (const UserError& error) {
        spec.origin.Refuse("centerline", error.what());
      }
      return site;
    case MeasuredAt::kTip:
      break;
  }
  if (spec.instrument) {
    site.instrument = context.FindInstrument(*spec.instrument, spec, "instrument");
    return site;
  }
  for (std::size_t k = 0; k < context.instruments.size() && !site.instrument; ++k) {
    if (context.instruments[k].inner_radius_mm > 0) site.instrument = static_cast<int>(k);
  }
  if (!site.instrument) {
    spec.origin.Refuse("at",
                       "no instrument has a lumen to measure a pressure through; set at = "
                       "\"entry\" for a catheter that ends at the entry, or name an instrument "
                       "with a sensor");
  }
  return site;
}

std::unique_ptr<Effect> MakePatientMonitor(const MonitorSpec& spec, const EffectContext& context) {
  const VitalSigns::Limits limits{.rate_low_per_min = spec.rate_low_per_min,
                                  .rate_high_per_min = spec.rate_high_per_min,
                                  .systolic_low_mmHg = spec.systolic_low_mmHg,
                                  .systolic_high_mmHg = spec.systolic_high_mmHg};
  return std::make_unique<PatientMonitor>(FindHeart(spec, context), FindPressureSite(spec, context),
                                          limits, context);
}

}  // namespace

EffectKind PatientMonitorKind() {
  return {.name = "patient_monitor",
          .summary =
              "ECG of the heartbeat or the flow, pressure of the flow at a tip, alarms; needs "
              "[effects.flow] or [effects.heartbeat]",
          .roles = "observer",
          .keys = Any(MonitorKeys()),
          .make = MakeWith(MakePatientMonitor)};
}

}  // namespace torquer::effects
