#include "host/recorder/page_figures.h"

#include <fmt/format.h>

#include <algorithm>

#include "host/recorder/page_text.h"

namespace torquer {
namespace {

double CountsApart(const InstrumentReport& instrument) {
  return std::max(instrument.axial.error_counts, instrument.rotation.error_counts);
}

// ", at 0:12.3 min"; "" of an empty series.
std::string TimeOfPeak(const Series& series) {
  const std::vector<SeriesPoint> points = series.Points();
  if (points.empty()) return "";
  const auto lower = [](const SeriesPoint& a, const SeriesPoint& b) { return a.value < b.value; };
  return ", at " + SecondsText(std::max_element(points.begin(), points.end(), lower)->time_s);
}

std::string InjectionText(const PowerInjection& injection) {
  std::string volume = ValueText(injection.delivered_mL) + " mL";
  if (!injection.complete()) {
    volume = (injection.aborted ? "aborted after " : "unfinished, ") + volume + " of " +
             ValueText(injection.volume_mL) + " mL";
  }
  return fmt::format("{} at {} mL/s, from {}", volume, ValueText(injection.rate_mL_s),
                     SecondsText(injection.start_s));
}

// Doubt about an instrument that is not good.
std::string DoubtOf(const InstrumentReport& instrument) {
  if (!instrument.reports_lost) {
    return " may have lost reports of its device: their number is not known.";
  }
  if (*instrument.reports_lost > 0) {
    return fmt::format(" lost {} reports of its device.", *instrument.reports_lost);
  }
  return fmt::format(" did not follow its hand: they are {} counts of the sensor apart.",
                     ValueText(CountsApart(instrument)));
}

}  // namespace

std::optional<double> PageFigures::Reading(const char* name) const {
  return FindReading(report_.readings, name);
}

bool PageFigures::AboveLimit() const {
  return now_.wall_force_mN && limits_.force_limit_mN &&
         *now_.wall_force_mN > *limits_.force_limit_mN;
}

std::string PageFigures::TipPath() const {
  return now_.tip_path_mm ? ValueText(*now_.tip_path_mm) + " mm" : "not known";
}

std::string PageFigures::Patch() const {
  return limits_.patch_mm ? fmt::format("any {:g} mm of the instrument", *limits_.patch_mm)
                          : "any stretch of the instrument";
}

PageVerdict PageFigures::Verdict() const {
  if (!now_.gradable) {
    return {PageVerdict::Kind::kOpen, "Not gradable",
            "The session cannot be repeated exactly: " + SafeText(report_.not_gradable) +
                ". The values below are those of the live session. They depend on the load of the "
                "machine, so they are not marks."};
  }
  if (!now_.target_reached && report_.Has("assessment")) {
    return {
        PageVerdict::Kind::kOpen, "Not known",
        "The result of this session is not known: the simulation never settled, or its readings "
        "are missing. The measured values are below."};
  }
  if (!now_.target_reached) {
    return {PageVerdict::Kind::kOpen, "Not assessed",
            "This scene has no task, so the session is not judged. The measured values are below."};
  }
  const bool reached = *now_.target_reached;
  PageVerdict verdict;
  verdict.kind = reached && !now_.safe          ? PageVerdict::Kind::kOpen
                 : reached && now_.safe == true ? PageVerdict::Kind::kGood
                                                : PageVerdict::Kind::kPoor;
  verdict.headline = !reached     ? "&#x2717; Target not reached"
                     : !now_.safe ? "Target reached; safety not known"
                     : *now_.safe ? "&#x2713; Target reached safely"
                                  : "&#x2717; Target reached, but not safely";
  verdict.text =
      !reached        ? "The tip did not reach the target in " + SecondsText(now_.procedure_s) + "."
      : now_.target_s ? "The tip reached the target after " + SecondsText(*now_.target_s) + "."
                      : "The tip reached the target; the time is not known.";
  if (!now_.wall_force_mN) return verdict;
  verdict.text += " The largest force on the wall was " + ForceText(*now_.wall_force_mN);
  if (limits_.force_limit_mN) {
    verdict.text += std::string(AboveLimit() ? ", above" : ", within") + " the limit of " +
                    LimitText(*limits_.force_limit_mN);
  }
  verdict.text += ".";
  return verdict;
}

std::vector<std::string> PageFigures::Doubts() const {
  std::vector<std::string> doubts;
  for (const InstrumentReport& instrument : report_.instruments) {
    if (!instrument.driven() || instrument.Good()) continue;
    doubts.push_back("The " + SafeText(instrument.name) + DoubtOf(instrument));
  }
  if (report_.undecodable > 0) {
    doubts.push_back(
        fmt::format("{} messages of the recording cannot be read.", report_.undecodable));
  }
  for (const auto* const lines : {&report_.gaps, &report_.silences}) {
    for (const std::string& line : *lines) {
      doubts.push_back("In the recording: " + SafeText(line) + ".");
    }
  }
  for (const auto& [channel, count] : report_.unknown) {
    doubts.push_back(fmt::format("{} messages of the recording are of an unknown channel, {}.",
                                 count, SafeText(channel)));
  }
  if (report_.damage.any()) {
    doubts.push_back("The recording is damaged: " + SafeText(report_.damage.Describe()) + ".");
  }
  if (!report_.ended) {
    doubts.emplace_back("The recording ends before the session; it is judged up to there.");
  }
  if (scene_changed_) {
    doubts.emplace_back(
        "The scene file has changed since the session; limits and vessel are the present ones.");
  }
  const double unsettled_s = Reading("wall_force_unconverged_s").value_or(0);
  if (unsettled_s > 0.01 * now_.procedure_s) {
    doubts.push_back("The simulation had not settled for " + SecondsText(unsettled_s) +
                     "; forces of that time are not counted.");
  }
  const std::optional<double> error_mm = Reading("segment_error_largest_ever_mm");
  if (error_mm && limits_.target_radius_mm && *error_mm > *limits_.target_radius_mm) {
    doubts.push_back(
        fmt::format("With shorter segments the wire may lie up to {} mm elsewhere (an estimate), "
                    "and the target has a radius of {:g} mm. So the target and the way may be "
                    "judged otherwise.",
                    ValueText(*error_mm), *limits_.target_radius_mm));
  }
  return doubts;
}

std::vector<PageFinding> PageFigures::Findings() const {
  std::vector<PageFinding> findings;
  if (!now_.gradable) return findings;
  if (now_.target_reached || report_.Has("assessment")) AddTarget(findings);
  AddWall(findings);
  if (now_.target_reached || report_.Has("assessment")) AddWay(findings);
  return findings;
}

void PageFigures::AddTarget(std::vector<PageFinding>& findings) const {
  const bool reached = now_.target_reached.value_or(false);
  std::string target = "Target";
  if (limits_.target_at_mm) {
    target += fmt::format(": {:g} mm along {}", *limits_.target_at_mm,
                          SafeText(limits_.target_centerline));
  }
  findings.push_back({target,
                      !now_.target_reached ? "not known"
                      : !reached           ? "not reached"
                      : now_.target_s      ? "reached after " + SecondsText(*now_.target_s)
                                           : "reached; time not known",
                      limits_.target_radius_mm
                          ? fmt::format("tip within {:g} mm of it", *limits_.target_radius_mm)
                          : "tip near it",
                      !now_.target_reached ? ""
                      : reached            ? "&#x2713; reached"
                                           : "&#x2717; not reached"});
}

// Wall measurements of the scene, with or without an assessment.
void PageFigures::AddWall(std::vector<PageFinding>& findings) const {
  if (now_.wall_force_mN) {
    const bool limited = limits_.force_limit_mN.has_value();
    findings.push_back({"Largest force on the wall, on " + Patch(),
                        ForceText(*now_.wall_force_mN) + TimeOfPeak(report_.course.wall_force_mN()),
                        limited ? LimitText(*limits_.force_limit_mN) : "none set",
                        !limited       ? ""
                        : AboveLimit() ? "&#x2717; above the limit"
                                       : "&#x2713; within the limit"});
  } else if (report_.Has("wall_force")) {
    findings.push_back({"Largest force on the wall, on " + Patch(), "not known",
                        limits_.force_limit_mN ? LimitText(*limits_.force_limit_mN) : "none set",
                        ""});
  }
  if (const auto events = Reading("wall_force_events")) {
    std::string above = "Force above the scene's threshold";
    if (limits_.threshold_mN) above += " of " + LimitText(*limits_.threshold_mN);
    findings.push_back({above,
                        TimesText(*events) + ", " +
                            SecondsText(Reading("wall_force_above_s").value_or(0)) + " in total",
                        "none set", ""});
  }
  if (const auto pressure = Reading("wall_tip_pressure_ever_kPa")) {
    findings.push_back({"Largest pressure of the tip's end, along the wire",
                        ValueText(*pressure) + " kPa", "none set", ""});
  }
}

void PageFigures::AddWay(std::vector<PageFinding>& findings) const {
  if (const auto entries = Reading("wrong_vessel_entries")) {
    findings.push_back({"Wrong vessels entered", TimesText(*entries), "none set",
                        *entries == 0 ? "stayed on the route" : "left the route to the target"});
  }
  if (const auto retractions = Reading("retractions")) {
    findings.push_back({"Retractions of 2 mm or more",
                        TimesText(*retractions) + ", " +
                            ValueText(Reading("retracted_mm").value_or(0)) + " mm in total",
                        "none set", ""});
  }
  if (const auto ratio = Reading("tip_path_ratio")) {
    findings.push_back(
        {"Path length of the tip", TipPath(), "none set",
         ValueText(*ratio) + " times the length of the route from its start to the target"});
  }
}

std::vector<PageRow> PageFigures::Radiation() const {
  std::vector<PageRow> rows = {
      {"Duration of the procedure", SecondsText(now_.procedure_s)},
      {"Fluoroscopy time",
       now_.fluoroscopy_s ? SecondsText(*now_.fluoroscopy_s) : "no X-ray in this scene"}};
  if (const auto pulses = Reading("xray_pulses")) {
    rows.push_back({"X-ray pulses", fmt::format("{:.0f} pulses", *pulses)});
  }
  const auto dose = [&](const char* label, const char* name, const char* unit) {
    const std::optional<double> sum = FindOverPlanes(report_.readings, name);
    if (!sum) return;
    std::string text = ValueText(*sum) + unit;
    if (const auto second = FindReading(report_.readings, std::string("lateral_") + name)) {
      text +=
          fmt::format(": plane A {}, plane B {}", ValueText(*Reading(name)), ValueText(*second));
    }
    rows.push_back({label, std::move(text)});
  };
  dose("Air kerma at the reference point", "air_kerma_mGy", " mGy");
  if (now_.air_kerma_mGy_min) {
    rows.push_back(
        {"Its mean rate with the pedal down", ValueText(*now_.air_kerma_mGy_min) + " mGy/min"});
  }
  dose("Kerma-area product", "kerma_area_Gy_cm2", " Gy cm&#xb2;");
  if (now_.contrast_mL) {
    std::string injected = ValueText(*now_.contrast_mL) + " mL";
    if (const auto limit_mL = Reading("contrast_limit_mL")) {
      injected += (*now_.contrast_mL > *limit_mL ? ", above" : ", within") +
                  (" the patient's limit of " + ValueText(*limit_mL)) + " mL";
    }
    rows.push_back({"Contrast agent", std::move(injected)});
    int number = 0;
    for (const PowerInjection& injection : report_.course.injections()) {
      rows.push_back({fmt::format("Power injection {}", ++number), InjectionText(injection)});
    }
    rows.push_back({"Time of injection", SecondsText(report_.course.contrast().total_s())});
  } else {
    rows.push_back({"Contrast agent", "none in this scene"});
  }
  return rows;
}

std::vector<PageRow> PageFigures::Phases() const {
  std::vector<PageRow> rows;
  const auto add = [&rows](const char* name, const std::optional<double>& time_s) {
    if (time_s) rows.push_back({name, SecondsText(*time_s)});
  };
  add("Before the first motion", now_.before_motion_s);
  add(now_.target_s ? "From there to the target" : "From there to the end", now_.on_the_way_s);
  add("After the target", now_.after_target_s);
  if (now_.blind_mm && now_.blind_s) {
    rows.push_back({"Moving without X-ray",
                    SecondsText(*now_.blind_s) + ", " + ValueText(*now_.blind_mm) + " mm"});
  }
  return rows;
}

std::vector<PageRow> PageFigures::Motion() const {
  const SessionCourse& course = report_.course;
  std::vector<PageRow> rows = {
      {"Path length of the tip", TipPath()},
      {"Speed of the tip while it moved",
       course.moving_speed_mm_s()
           ? fmt::format("{} mm/s mean, {} mm/s peak", ValueText(*course.moving_speed_mm_s()),
                         ValueText(course.peak_speed_mm_s()))
           : "it did not move"}};
  for (const InstrumentCourse& instrument : course.instruments()) {
    rows.push_back({"Reversals, " + SafeText(instrument.name),
                    TimesText(static_cast<double>(instrument.reversals))});
  }
  int number = 0;
  for (const ReportExchange& exchange : report_.exchanges) {
    rows.push_back({fmt::format("Exchange {}, at {}", ++number, SecondsText(exchange.time_s)),
                    SafeText(exchange.instrument) + " for " + SafeText(exchange.device)});
  }
  if (const auto submovements = Reading("submovements")) {
    rows.push_back({"Separate movements of the hand", TimesText(*submovements)});
  }
  if (const auto jerk = Reading("log_dimensionless_jerk")) {
    rows.push_back({"Smoothness of the hand", "LDLJ " + ValueText(*jerk) + " (no unit)"});
  }
  return rows;
}

std::string PageFigures::Share(std::int64_t ticks) const {
  const auto all = static_cast<double>(std::max<std::int64_t>(report_.solver.ticks, 1));
  return fmt::format("{} ticks ({} %)", ticks, ValueText(100 * static_cast<double>(ticks) / all));
}

std::vector<PageRow> PageFigures::Solver() const {
  const SolverHealth& solver = report_.solver;
  std::vector<PageRow> rows = {
      {"Simulated", fmt::format("{} ticks", solver.ticks)},
      {"Not in equilibrium at the end of a tick", Share(solver.unconverged)},
      {"&#x2003;because the time budget was spent", Share(solver.budget_spent)},
      {"&#x2003;because no step reduced the residual", Share(solver.stalled)},
      {"Outside the vessel", Share(solver.outside)},
      {"Tip snapped to another shape", Share(solver.snapped)},
      {"Largest penetration of the wall", ValueText(report_.max_penetration_um) + " &#xb5;m"},
      {"Largest residual in equilibrium",
       solver.largest_residual ? ValueText(*solver.largest_residual) + " (no unit)" : "not known"},
      {"Time for a tick",
       fmt::format("{} &#xb5;s median, {} &#xb5;s 99th percentile", ValueText(report_.solve_us.p50),
                   ValueText(report_.solve_us.p99))}};
  if (report_.Has("segment_error")) {
    const std::optional<double> error_mm = Reading("segment_error_largest_ever_mm");
    rows.push_back({"Largest error by the segments, an estimate",
                    error_mm ? ValueText(*error_mm) + " mm" : "not known"});
  }
  // Scenes without the effect do not look for it.
  if (const auto events = Reading("left_model_events")) {
    rows.push_back({"Left the model at an outlet, and was held there",
                    TimesText(*events) + ", " + Share(solver.left_model)});
  }
  return rows;
}

std::vector<PageRow> PageFigures::Device() const {
  std::vector<PageRow> rows;
  for (const InstrumentReport& instrument : report_.instruments) {
    const std::string name = SafeText(instrument.name);
    if (!instrument.driven()) {
      rows.push_back({name, "driven by no device"});
      continue;
    }
    rows.push_back({name + ": reports of the device lost",
                    instrument.reports_lost ? fmt::format("{} reports", *instrument.reports_lost)
                                            : "not known"});
    rows.push_back(
        {name + ": hand against instrument", ValueText(CountsApart(instrument)) + " counts apart"});
    const Distribution& latency_ms = instrument.latency_ms;
    rows.push_back({name + ": from hand to simulation",
                    latency_ms.count == 0
                        ? "not known"
                        : fmt::format("{} ms median, {} ms 99th percentile",
                                      ValueText(latency_ms.p50), ValueText(latency_ms.p99))});
  }
  rows.push_back({"Motion in doubt (sensor or commands missing)", Share(report_.solver.in_doubt)});
  rows.push_back({"Missing from the recording", fmt::format("{} ticks", report_.states_missing)});
  return rows;
}

}  // namespace torquer
