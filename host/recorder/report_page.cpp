#include "host/recorder/report_page.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <utility>
#include <vector>

#include "host/recorder/page_style.h"
#include "host/recorder/panel_plot.h"
#include "host/recorder/svg_text.h"
#include "host/support/printable_text.h"

namespace torquer {
namespace {

// A figure, and what it says, escaped already.
struct Row {
  std::string name;
  std::string value;
};

// A measure of the assessment: what was found, what it is held to, and what that means.
struct Finding {
  std::string name;
  std::string found;
  std::string limit;
  std::string meaning;
};

// Text of any origin, for a page.
std::string Safe(std::string_view text) { return EscapeMarkup(Printable(text)); }

std::string Seconds(double seconds) {
  if (seconds < 99.95) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<std::int64_t>(std::lround(seconds));
  return fmt::format("{} min {:02} s", whole / 60, whole % 60);
}

std::string Times(double count) {
  if (count == 0) return "never";
  return count == 1 ? "once" : fmt::format("{:.0f} times", count);
}

std::string Force(double force_mN) {
  return fmt::format("{:.{}f} mN", force_mN, std::abs(force_mN) < 10 ? 2 : 1);
}

// A limit is a round number, and stays one.
std::string Limit(double force_mN) { return fmt::format("{:g} mN", force_mN); }

std::string DateOf(std::int64_t wall_clock_us) {
  constexpr std::int64_t kYear2100Us = 4'102'444'800'000'000;
  if (wall_clock_us <= 0 || wall_clock_us >= kYear2100Us) return "at an unknown time";
  return fmt::format("{:%Y-%m-%d %H:%M} UTC",
                     fmt::gmtime(static_cast<std::time_t>(wall_clock_us / 1'000'000)));
}

/// Writes one page from the top down.
class Page {
 public:
  Page(const SessionReport& report, const PageParts& parts)
      : report_(report), parts_(parts), now_(Summarize(report)) {}

  std::string Write() {
    Head();
    Result();
    TimeLine();
    Figures();
    LearningCurve();
    Picture();
    Methods();
    out_ += "</main></body></html>\n";
    return std::move(out_);
  }

 private:
  std::optional<double> Reading(const char* name) const {
    return FindReading(report_.readings, name);
  }
  bool AboveLimit() const {
    return now_.wall_force_mN && parts_.limits.force_limit_mN &&
           *now_.wall_force_mN > *parts_.limits.force_limit_mN;
  }
  std::string Patch() const {
    return parts_.limits.patch_mm
               ? fmt::format("any {:g} mm of the instrument", *parts_.limits.patch_mm)
               : "any stretch of the instrument";
  }

  void Head() {
    const std::string scene = Safe(report_.scene);
    Append(out_,
           "<!DOCTYPE html>\n<html xmlns=\"http://www.w3.org/1999/xhtml\" lang=\"en\"><head>"
           "<meta charset=\"utf-8\"/>\n"
           "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; "
           "style-src 'unsafe-inline'\"/>\n"
           "<meta name=\"viewport\" content=\"width=device-width\"/>\n"
           "<title>Session in {}</title>\n<style>{}</style></head>\n<body><main>\n",
           scene, kPageStyle);
    std::string instruments;
    for (const InstrumentReport& instrument : report_.instruments) {
      instruments += (instruments.empty() ? "" : ", ") + Safe(instrument.name);
    }
    Append(
        out_,
        "<h1>Training session: {}</h1>\n<p class=\"facts\">Began {}, recorded for {}. Vessel: {}. "
        "Instruments: {}.<br/>Recording: {}</p>\n",
        scene, DateOf(report_.started_us), Seconds(report_.duration_s),
        Safe(report_.description.vessel), instruments,
        Safe(std::filesystem::path(parts_.log).filename().string()));
  }

  void Result() {
    out_ += "<section class=\"whole\">\n<h2>Result</h2>\n";
    Verdict();
    Doubts();
    const std::vector<Finding> findings = now_.target_reached ? Assessed() : Measured();
    if (!findings.empty()) {
      out_ +=
          "<table "
          "class=\"findings\"><thead><tr><th>What</th><th>Found</th><th>Limit</th><th>Meaning</"
          "th></tr></thead>"
          "<tbody>\n";
      for (const Finding& finding : findings) {
        Append(out_, "<tr><td>{}</td><td class=\"number\">{}</td><td>{}</td><td>{}</td></tr>\n",
               finding.name, finding.found, finding.limit, finding.meaning);
      }
      out_ += "</tbody></table>\n";
    }
    out_ += "</section>\n";
  }

  void Verdict() {
    const char* look = "open";
    std::string headline = "Not assessed";
    std::string sentence =
        "This scene sets no task, so nobody was judged. What was measured is below.";
    if (now_.target_reached) {
      const bool reached = *now_.target_reached;
      const bool safe = now_.safe.value_or(false);
      look = reached && safe ? "good" : "poor";
      headline = !reached ? "&#x2717; Target not reached"
                 : safe   ? "&#x2713; Target reached safely"
                          : "&#x2717; Target reached, but not safely";
      sentence = reached ? "The tip reached the target after " +
                               Seconds(now_.target_s.value_or(now_.procedure_s)) + "."
                         : "The tip did not reach the target in " + Seconds(now_.procedure_s) + ".";
      if (now_.wall_force_mN) {
        sentence += " The largest force on the wall was " + Force(*now_.wall_force_mN);
        if (parts_.limits.force_limit_mN) {
          sentence += std::string(AboveLimit() ? ", above" : ", within") + " the limit of " +
                      Limit(*parts_.limits.force_limit_mN);
        }
        sentence += ".";
      }
    }
    Append(out_, "<div class=\"verdict {}\"><strong>{}</strong>{}</div>\n", look, headline,
           sentence);
  }

  // Why the figures may not be what the trainee did.
  void Doubts() {
    std::vector<std::string> doubts;
    for (const InstrumentReport& instrument : report_.instruments) {
      if (!instrument.driven() || instrument.Good()) continue;
      const bool lost = instrument.reports_lost != 0;
      doubts.push_back(
          "The " + Safe(instrument.name) +
          (lost ? instrument.reports_lost < 0
                      ? std::string(" may have lost reports of its device: nobody counted them.")
                      : fmt::format(" lost {} reports of its device.", instrument.reports_lost)
                : fmt::format(
                      " did not go where the hand went: {:.1f} counts of its sensor apart.",
                      std::max(instrument.axial.error_counts, instrument.rotation.error_counts))));
    }
    if (report_.undecodable > 0) {
      doubts.push_back(
          fmt::format("{} messages of the recording cannot be read.", report_.undecodable));
    }
    if (report_.damage.any()) {
      doubts.push_back("The recording is damaged: " + Safe(report_.damage.Describe()) + ".");
    }
    if (!report_.ended) {
      doubts.emplace_back("The recording ends before the session; it is judged up to there.");
    }
    if (parts_.scene_changed) {
      doubts.emplace_back(
          "The scene file has changed since the session: limits and vessel are those of now.");
    }
    const double unsettled_s = Reading("wall_force_unconverged_s").value_or(0);
    if (unsettled_s > 0.01 * now_.procedure_s) {
      doubts.push_back("For " + Seconds(unsettled_s) +
                       " the simulation had not settled; forces of that time are not counted.");
    }
    for (const std::string& doubt : doubts) {
      out_ += "<p class=\"note\"><b>Note:</b> " + doubt + "</p>\n";
    }
  }

  std::vector<Finding> Assessed() const {
    const SessionLimits& limits = parts_.limits;
    std::vector<Finding> findings;
    const bool reached = *now_.target_reached;
    std::string target = "Target";
    if (limits.target_at_mm) {
      target +=
          fmt::format(": {:g} mm along {}", *limits.target_at_mm, Safe(limits.target_centerline));
    }
    findings.push_back(
        {target, reached ? "reached after " + Seconds(now_.target_s.value_or(0)) : "not reached",
         limits.target_radius_mm ? fmt::format("tip within {:g} mm of it", *limits.target_radius_mm)
                                 : "tip near it",
         reached ? "&#x2713; reached" : "&#x2717; not reached"});
    for (Finding& finding : Measured()) findings.push_back(std::move(finding));
    if (const auto entries = Reading("wrong_vessel_entries")) {
      findings.push_back({"Wrong vessels entered", Times(*entries), "none set",
                          *entries == 0 ? "stayed on the way" : "left the way to the target"});
    }
    if (const auto retractions = Reading("retractions")) {
      findings.push_back({"Pulled back by 2 mm or more",
                          Times(*retractions) + fmt::format(", {:.1f} mm in all",
                                                            Reading("retracted_mm").value_or(0)),
                          "none set", ""});
    }
    if (const auto ratio = Reading("tip_path_ratio")) {
      findings.push_back({"Path length of the tip", fmt::format("{:.0f} mm", now_.tip_path_mm),
                          "none set",
                          fmt::format("{:.2f} times the length of the way to the target", *ratio)});
    }
    return findings;
  }

  // What the scene measures of the wall, with an assessment or without.
  std::vector<Finding> Measured() const {
    std::vector<Finding> findings;
    if (now_.wall_force_mN) {
      const bool limited = parts_.limits.force_limit_mN.has_value();
      findings.push_back({"Largest force on the wall, on " + Patch(), Force(*now_.wall_force_mN),
                          limited ? Limit(*parts_.limits.force_limit_mN) : "none set",
                          !limited       ? ""
                          : AboveLimit() ? "&#x2717; above the limit"
                                         : "&#x2713; within the limit"});
    }
    if (const auto events = Reading("wall_force_events")) {
      std::string above = "Force above the scene's threshold";
      if (parts_.limits.threshold_mN) above += " of " + Limit(*parts_.limits.threshold_mN);
      findings.push_back(
          {above,
           Times(*events) + ", " + Seconds(Reading("wall_force_above_s").value_or(0)) + " in all",
           "none set", ""});
    }
    if (const auto pressure = Reading("wall_tip_pressure_ever_kPa")) {
      findings.push_back({"Largest pressure of the tip's end, along the wire",
                          fmt::format("{:.1f} kPa", *pressure), "none set", ""});
    }
    return findings;
  }

  void TimeLine() {
    const SessionCourse& course = report_.course;
    PlotPanel insertion{.title = "Insertion (mm)"};
    PlotPanel rotation{.title = "Rotation (degrees)"};
    for (const InstrumentCourse& instrument : course.instruments()) {
      const std::string label =
          course.instruments().size() > 1 ? Printable(instrument.name) : std::string();
      insertion.curves.push_back({label, instrument.insertion_mm.Points()});
      rotation.curves.push_back({label, instrument.rotation_deg.Points()});
    }
    PlotPanel speed{.title = "Speed of the tip (mm/s)",
                    .curves = {{"", course.tip_speed_mm_s().Points()}},
                    .from_zero = true};
    std::vector<PlotPanel> panels = {std::move(insertion), std::move(rotation), std::move(speed)};
    if (!course.wall_force_mN().empty())
      panels.push_back(ForcePanel(course.wall_force_mN().Points()));
    PlotPanel pedals{.title = "X-ray and contrast (bar: pedal down)"};
    if (report_.Has("fluoroscopy") || !course.xray().spans().empty()) {
      pedals.bars.push_back({"X-ray", course.xray().spans()});
    }
    if (report_.Has("contrast") || !course.contrast().spans().empty()) {
      pedals.bars.push_back({"Contrast", course.contrast().spans()});
    }
    if (!pedals.bars.empty()) panels.push_back(std::move(pedals));
    const PlotAxis axis{.label = "Time since the simulator began (s)",
                        .begin = course.begin_s(),
                        .end = course.end_s(),
                        .mark = now_.target_s,
                        .mark_label = "dashed: target reached"};
    out_ += "<section class=\"whole\">\n<h2>Time line</h2>\n<figure>\n";
    out_ += DrawPanels("Time line of the session", panels, axis);
    out_ += "</figure>\n</section>\n";
  }

  PlotPanel ForcePanel(std::vector<SeriesPoint> points) const {
    PlotPanel panel{.title = "Largest force on the wall (mN)",
                    .curves = {{"", std::move(points)}},
                    .from_zero = true};
    if (parts_.limits.force_limit_mN) {
      panel.limit = {*parts_.limits.force_limit_mN,
                     "limit " + Limit(*parts_.limits.force_limit_mN)};
    }
    return panel;
  }

  void Figures() {
    out_ += "<section>\n<h2>Figures</h2>\n<div class=\"columns\">\n";
    Table("Radiation and contrast", Radiation());
    Table("Motion", Motion());
    Table("Quality of the simulation", Solver());
    Table("Device and recording", Device());
    out_ += "</div>\n</section>\n";
  }

  void Table(const char* heading, const std::vector<Row>& rows) {
    Append(out_, "<div><h3>{}</h3>\n<table><tbody>\n", heading);
    for (const Row& row : rows) {
      Append(out_, "<tr><td>{}</td><td class=\"number\">{}</td></tr>\n", row.name, row.value);
    }
    out_ += "</tbody></table></div>\n";
  }

  std::vector<Row> Radiation() const {
    std::vector<Row> rows = {{"Duration of the procedure", Seconds(now_.procedure_s)},
                             {"Fluoroscopy time", now_.fluoroscopy_s ? Seconds(*now_.fluoroscopy_s)
                                                                     : "no X-ray in this scene"}};
    if (const auto pulses = Reading("xray_pulses")) {
      rows.push_back({"X-ray pulses", fmt::format("{:.0f} pulses", *pulses)});
    }
    if (const auto kerma = Reading("air_kerma_mGy")) {
      rows.push_back({"Air kerma at the reference point", fmt::format("{:.3g} mGy", *kerma)});
    }
    if (now_.contrast_mL) {
      rows.push_back({"Contrast agent", fmt::format("{:.1f} mL", *now_.contrast_mL)});
      rows.push_back({"Time of injection", Seconds(report_.course.contrast().total_s())});
    } else {
      rows.push_back({"Contrast agent", "none in this scene"});
    }
    return rows;
  }

  std::vector<Row> Motion() const {
    const SessionCourse& course = report_.course;
    std::vector<Row> rows = {{"Path length of the tip", fmt::format("{:.0f} mm", now_.tip_path_mm)},
                             {"Speed of the tip while it moved",
                              fmt::format("{:.1f} mm/s mean, {:.1f} mm/s peak",
                                          course.moving_speed_mm_s(), course.peak_speed_mm_s())}};
    for (const InstrumentCourse& instrument : course.instruments()) {
      rows.push_back({"Reversals, " + Safe(instrument.name),
                      Times(static_cast<double>(instrument.reversals))});
    }
    if (const auto submovements = Reading("submovements")) {
      rows.push_back({"Separate movements of the hand", Times(*submovements)});
    }
    if (const auto jerk = Reading("log_dimensionless_jerk")) {
      rows.push_back({"Smoothness of the hand", fmt::format("LDLJ {:.1f} (no unit)", *jerk)});
    }
    return rows;
  }

  std::string Share(std::int64_t ticks) const {
    const auto all = static_cast<double>(std::max<std::int64_t>(report_.course.solver().ticks, 1));
    return fmt::format("{} ticks ({:.2f} %)", ticks, 100 * static_cast<double>(ticks) / all);
  }

  std::vector<Row> Solver() const {
    const SolverHealth& solver = report_.course.solver();
    return {{"Simulated", fmt::format("{} ticks", solver.ticks)},
            {"Not in equilibrium at the end of a tick", Share(solver.unconverged)},
            {"&#x2003;for lack of time", Share(solver.budget_spent)},
            {"&#x2003;because no step came nearer", Share(solver.stalled)},
            {"Outside the vessel", Share(solver.outside)},
            {"Sprang to another shape", Share(solver.snapped)},
            {"Deepest in the wall", fmt::format("{:.1f} &#xb5;m", report_.max_penetration_um)},
            {"Largest residual in equilibrium",
             fmt::format("{:.1e} (no unit)", solver.largest_residual)},
            {"Time for a tick", fmt::format("{:.0f} &#xb5;s median, {:.0f} &#xb5;s 99th percentile",
                                            report_.solve_us.p50, report_.solve_us.p99)}};
  }

  std::vector<Row> Device() const {
    std::vector<Row> rows;
    for (const InstrumentReport& instrument : report_.instruments) {
      const std::string name = Safe(instrument.name);
      if (!instrument.driven()) {
        rows.push_back({name, "driven by no device"});
        continue;
      }
      rows.push_back({name + ": reports of the device lost",
                      instrument.reports_lost < 0
                          ? "not known"
                          : fmt::format("{} reports", instrument.reports_lost)});
      rows.push_back(
          {name + ": hand against instrument",
           fmt::format("{:.2f} counts apart",
                       std::max(instrument.axial.error_counts, instrument.rotation.error_counts))});
      rows.push_back({name + ": from hand to simulation",
                      fmt::format("{:.1f} ms median, {:.1f} ms 99th percentile",
                                  instrument.latency_ms.p50, instrument.latency_ms.p99)});
    }
    rows.push_back(
        {"Motion in doubt (sensor or commands missing)", Share(report_.course.solver().in_doubt)});
    rows.push_back({"Missing from the recording", fmt::format("{} ticks", report_.states_missing)});
    return rows;
  }

  void LearningCurve() {
    out_ += "<section>\n<h2>Earlier sessions in this scene</h2>\n";
    if (parts_.earlier.sessions.empty()) {
      out_ +=
          "<p>None was found beside this report. Later ones will show the learning curve.</p>\n";
    } else {
      DrawCurve();
    }
    for (const std::string& refused : parts_.earlier.refused) {
      out_ += "<p class=\"note\"><b>Left out:</b> " + Safe(refused) + "</p>\n";
    }
    out_ += "</section>\n";
  }

  void DrawCurve() {
    std::vector<SessionSummary> sessions = parts_.earlier.sessions;
    sessions.push_back(now_);
    std::vector<PlotPanel> panels;
    const auto add = [&](PlotPanel panel, const auto& value) {
      PlotCurve curve;
      for (std::size_t i = 0; i < sessions.size(); ++i) {
        const std::optional<double> one = value(sessions[i]);
        if (one) curve.points.push_back({static_cast<double>(i + 1), *one});
      }
      if (curve.points.empty()) return;
      panel.curves = {std::move(curve)};
      panel.from_zero = true;
      panels.push_back(std::move(panel));
    };
    add({.title = "Time to the target (s)"}, [](const SessionSummary& s) { return s.target_s; });
    add(ForcePanel({}), [](const SessionSummary& s) { return s.wall_force_mN; });
    add({.title = "Fluoroscopy time (s)"}, [](const SessionSummary& s) { return s.fluoroscopy_s; });
    add({.title = "Path length of the tip (mm)"},
        [](const SessionSummary& s) { return std::optional<double>(s.tip_path_mm); });
    const auto count = static_cast<double>(sessions.size());
    out_ += "<figure>\n";
    out_ += DrawPanels("Learning curve", panels,
                       {.label = "Session in order of time; the last is this one",
                        .begin = 1,
                        .end = count,
                        .counts = true});
    out_ +=
        "</figure>\n<table "
        "class=\"sessions\"><thead><tr><th>Session</th><th>Began</th><th>Result</th>"
        "<th>Procedure</th><th>Largest force</th><th>Fluoroscopy</th><th>Contrast</th>"
        "<th>Path length of the tip</th><th>Reversals</th></tr></thead><tbody>\n";
    for (std::size_t i = 0; i < sessions.size(); ++i) AppendSession(i + 1, sessions[i]);
    out_ += "</tbody></table>\n";
  }

  void AppendSession(std::size_t number, const SessionSummary& session) {
    const auto or_dash = [](const auto& value, const auto& format) {
      return value ? format(*value) : std::string("&#x2013;");
    };
    const char* result = !session.target_reached    ? "not assessed"
                         : !*session.target_reached ? "&#x2717; not reached"
                         : session.safe == true     ? "&#x2713; safe"
                                                    : "&#x2717; unsafe";
    Append(out_,
           "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>"
           "<td>{:.0f} mm</td><td>{}</td></tr>\n",
           number, DateOf(session.started_us), result, Seconds(session.procedure_s),
           or_dash(session.wall_force_mN, Force), or_dash(session.fluoroscopy_s, Seconds),
           or_dash(session.contrast_mL, [](double mL) { return fmt::format("{:.1f} mL", mL); }),
           session.tip_path_mm, Times(static_cast<double>(session.reversals)));
  }

  void Picture() {
    if (parts_.picture.empty()) return;
    out_ +=
        "<section class=\"whole\">\n<h2>Where the instruments are at the end</h2>\n"
        "<figure class=\"picture\">\n" +
        parts_.picture +
        "<figcaption>Left the whole vessel from the front, right the surroundings of the tip. "
        "Cyan: the last 10 mm; thin white line: where the tip has been; orange dots: contact "
        "with the wall.</figcaption></figure>\n</section>\n";
  }

  void Methods() {
    out_ += "<section>\n<h2>How it was measured</h2>\n<ul class=\"small\">\n";
    out_ +=
        "<li>Forces and pressures are those of the simulation; they have not been compared with "
        "a patient's.";
    if (now_.wall_force_mN) {
      out_ += " The largest force is that on " + Patch() +
              ". Ticks that are not in equilibrium do not count for it.";
    }
    Append(out_,
           "</li>\n<li>The path length of the tip is added up in steps of {:g} mm. Its speed is "
           "the straight "
           "way in {:g} s over that time; it moves above {:g} mm/s.</li>\n"
           "<li>A reversal is a change of direction of the insertion by more than {:g} mm. Smooth "
           "motion of the tip goes with skill: Estrada et al., IEEE Transactions on Human-Machine "
           "Systems 46(5):647, 2016.</li>\n",
           SessionCourse::kPathStepMm, SessionCourse::kSpeedWindowS, SessionCourse::kRestingMmS,
           SessionCourse::kReversalMm);
    if (Reading("log_dimensionless_jerk")) {
      out_ +=
          "<li>LDLJ is the log dimensionless jerk of the hand's speed; the nearer to zero, the "
          "smoother: Balasubramanian et al., Journal of NeuroEngineering and Rehabilitation "
          "12:112, 2015.</li>\n";
    }
    out_ +=
        "<li>The residual is the largest out-of-balance moment over the local EI/(1 mm).</li>\n"
        "<li>Curves show the lowest and the highest value of each stretch of time, so that no "
        "peak is lost.</li>\n</ul>\n</section>\n";
  }

  const SessionReport& report_;
  const PageParts& parts_;
  const SessionSummary now_;
  std::string out_;
};

}  // namespace

std::string FormatPage(const SessionReport& report, const PageParts& parts) {
  return Page(report, parts).Write();
}

}  // namespace torquer
