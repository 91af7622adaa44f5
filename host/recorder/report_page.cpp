#include "host/recorder/report_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/recorder/page_figures.h"
#include "host/recorder/page_style.h"
#include "host/recorder/page_text.h"
#include "host/recorder/panel_plot.h"
#include "host/recorder/svg_text.h"
#include "host/support/printable_text.h"

namespace torquer {
namespace {

// The report of a session that went as the expert run.
SessionReport ReportOfExpert(const SessionReport& report) {
  SessionReport expert = report;
  expert.readings = report.expert->readings;
  expert.course = report.expert->course;
  expert.not_gradable.clear();
  return expert;
}

// Value of the row with this name; a dash if there is none.
template <class Row>
std::string ValueIn(const std::vector<Row>& rows, const std::string& name,
                    std::string Row::*value) {
  for (const Row& row : rows) {
    if (row.name == name) return row.*value;
  }
  return "&#x2013;";
}

/// Writes one page from the top down.
class Page {
 public:
  Page(const SessionReport& report, const PageParts& parts)
      : report_(report), parts_(parts), figures_(report, parts.limits, parts.scene_changed) {
    if (!report.expert) return;
    expert_report_.emplace(ReportOfExpert(report));
    expert_.emplace(*expert_report_, parts.limits, parts.scene_changed);
  }

  std::string Write() {
    Head();
    Result();
    TimeLine();
    Figures();
    LearningCurve();
    Picture();
    Methods();
    Quality();
    out_ += "</main></body></html>\n";
    return std::move(out_);
  }

 private:
  void Head() {
    const std::string scene = SafeText(report_.scene);
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
      instruments += (instruments.empty() ? "" : ", ") + SafeText(instrument.name);
    }
    Append(out_,
           "<h1>{}: {}</h1>\n<p class=\"facts\">{}Began {}, recorded for {}. Vessel: {}. "
           "Instruments: {}.<br/>Recording: {}</p>\n",
           report_.examination ? "Examination" : "Training session", scene, Trainee(),
           DateText(report_.started_us), SecondsText(report_.duration_s),
           SafeText(report_.description.vessel), instruments,
           SafeText(std::filesystem::path(parts_.log).filename().string()));
  }

  // "Trainee: NAME, group NAME." as a line; "" without a name.
  std::string Trainee() const {
    if (report_.trainee.empty()) return "";
    const std::string group = report_.group.empty() ? "" : ", group " + SafeText(report_.group);
    return "Trainee: " + SafeText(report_.trainee) + group + ".<br/>";
  }

  void Result() {
    out_ += "<section class=\"whole\">\n<h2>Result</h2>\n";
    const PageVerdict verdict = figures_.Verdict();
    const char* look = verdict.kind == PageVerdict::Kind::kGood   ? "good"
                       : verdict.kind == PageVerdict::Kind::kPoor ? "poor"
                                                                  : "open";
    Append(out_, "<div class=\"verdict {}\"><strong>{}</strong>{}</div>\n", look, verdict.headline,
           verdict.text);
    for (const std::string& doubt : figures_.Doubts()) Note("Note", doubt);
    if (report_.marks) Marks(*report_.marks);
    const std::vector<PageFinding> findings = figures_.Findings();
    if (!findings.empty()) {
      AppendFindings(findings);
    }
    out_ += "</section>\n";
  }

  void AppendFindings(const std::vector<PageFinding>& findings) {
    const std::vector<PageFinding> of_expert =
        expert_ ? expert_->Findings() : std::vector<PageFinding>();
    Append(out_,
           "<table class=\"findings\"><thead>"
           "<tr><th>Measure</th><th>Result</th>{}<th>Limit</th><th>Meaning</th></tr></thead>"
           "<tbody>\n",
           expert_ ? "<th>Expert run</th>" : "");
    for (const PageFinding& finding : findings) {
      Append(out_, "<tr><td>{}</td><td class=\"number\">{}</td>", finding.name, finding.found);
      if (expert_) {
        Append(out_, "<td class=\"number\">{}</td>",
               ValueIn(of_expert, finding.name, &PageFinding::found));
      }
      Append(out_, "<td>{}</td><td>{}</td></tr>\n", finding.limit, finding.meaning);
    }
    out_ += "</tbody></table>\n";
  }

  void Marks(const MarkSheet& sheet) {
    const std::optional<bool> all = sheet.Passed();
    Append(out_, "<p class=\"facts\"><b>Pass marks: {}</b> (by {})</p>\n", Verdict(all),
           SafeText(std::filesystem::path(sheet.file).filename().string()));
    out_ +=
        "<table class=\"findings\"><thead>"
        "<tr><th>Pass mark</th><th>Result</th><th>Limit</th><th>Verdict</th></tr></thead><tbody>\n";
    for (const Mark& mark : sheet.marks) {
      Append(out_, "<tr><td>{}</td><td class=\"number\">{}</td><td>{}</td><td>{}</td></tr>\n",
             SafeText(mark.label), SafeText(mark.found), SafeText(mark.limit),
             Verdict(mark.passed));
    }
    out_ += "</tbody></table>\n";
  }

  static std::string Verdict(const std::optional<bool>& passed) {
    const char* sign = !passed ? "" : *passed ? "&#x2713; " : "&#x2717; ";
    return sign + PassedText(passed);
  }

  void Note(const char* heading, const std::string& text) {
    Append(out_, "<p class=\"note\"><b>{}:</b> {}</p>\n", heading, text);
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
    if (!course.wall_force_mN().empty() || !course.unsettled_force_mN().empty()) {
      PlotPanel force = ForcePanel(course.wall_force_mN().Points());
      force.uncounted = course.unsettled_force_mN().Points();
      force.uncounted_label = "gray: not settled, does not count";
      panels.push_back(std::move(force));
    }
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
                        .mark = figures_.summary().target_s,
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
                     "limit " + LimitText(*parts_.limits.force_limit_mN)};
    }
    return panel;
  }

  void Figures() {
    out_ += "<section>\n<h2>Figures</h2>\n<div class=\"columns\">\n";
    CompareWithExpert("Radiation and contrast", &PageFigures::Radiation);
    CompareWithExpert("Motion", &PageFigures::Motion);
    CompareWithExpert("Phases", &PageFigures::Phases);
    out_ += "</div>\n</section>\n";
  }

  void Quality() {
    out_ += "<section>\n<h2>For developers</h2>\n<div class=\"columns\">\n";
    Table("Quality of the simulation", figures_.Solver());
    Table("Device and recording", figures_.Device());
    out_ +=
        "</div>\n<p class=\"small\">The residual is the largest out-of-balance moment over the "
        "local EI/(1 mm).</p>\n</section>\n";
  }

  // A table with the values of the expert run beside those of the session.
  void CompareWithExpert(const char* heading,
                         std::vector<PageRow> (PageFigures::*rows_of)() const) {
    const std::vector<PageRow> rows = (figures_.*rows_of)();
    if (rows.empty()) return;
    if (!expert_) return Table(heading, rows);
    const std::vector<PageRow> of_expert = ((*expert_).*rows_of)();
    Append(out_,
           "<div><h3>{}</h3>\n<table><thead><tr><th></th><th>Session</th><th>Expert run</th></tr>"
           "</thead><tbody>\n",
           heading);
    for (const PageRow& row : rows) {
      Append(out_, "<tr><td>{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td></tr>\n",
             row.name, row.value, ValueIn(of_expert, row.name, &PageRow::value));
    }
    out_ += "</tbody></table></div>\n";
  }

  void Table(const char* heading, const std::vector<PageRow>& rows) {
    Append(out_, "<div><h3>{}</h3>\n<table><tbody>\n", heading);
    for (const PageRow& row : rows) {
      Append(out_, "<tr><td>{}</td><td class=\"number\">{}</td></tr>\n", row.name, row.value);
    }
    out_ += "</tbody></table></div>\n";
  }

  void LearningCurve() {
    out_ += "<section>\n<h2>Earlier sessions in this scene</h2>\n";
    if (parts_.earlier.sessions.empty()) {
      out_ +=
          "<p>None was found beside this report. The learning curve begins with the next "
          "session.</p>\n";
    } else {
      DrawCurve();
    }
    for (const std::string& refused : parts_.earlier.refused) {
      Note("Left out", SafeText(refused));
    }
    out_ += "</section>\n";
  }

  void DrawCurve() {
    std::vector<SessionSummary> sessions = parts_.earlier.sessions;
    sessions.push_back(figures_.summary());
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
        [](const SessionSummary& s) { return s.tip_path_mm; });
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
        "<th>Pass marks</th>"
        "<th>Procedure</th><th>Largest force</th><th>Fluoroscopy</th><th>Contrast</th>"
        "<th>Path length of the tip</th><th>Reversals</th></tr></thead><tbody>\n";
    for (std::size_t i = 0; i < sessions.size(); ++i) AppendSession(i + 1, sessions[i]);
    out_ += "</tbody></table>\n";
  }

  void AppendSession(std::size_t number, const SessionSummary& session) {
    const auto or_dash = [](const auto& value, const auto& format) {
      return value ? format(*value) : std::string("&#x2013;");
    };
    const char* result = !session.gradable          ? "not gradable"
                         : !session.target_reached  ? "not assessed"
                         : !*session.target_reached ? "&#x2717; not reached"
                         : !session.safe            ? "reached; safety not known"
                         : *session.safe            ? "&#x2713; safe"
                                                    : "&#x2717; unsafe";
    Append(out_,
           "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>"
           "<td>{}</td><td>{}</td><td>{}</td></tr>\n",
           number,
           DateText(session.started_us.value_or(0)) + (session.examination ? ", examination" : ""),
           result, session.marks.empty() ? "&#x2013;" : Verdict(session.passed),
           SecondsText(session.procedure_s), or_dash(session.wall_force_mN, ForceText),
           or_dash(session.fluoroscopy_s, SecondsText),
           or_dash(session.contrast_mL, [](double mL) { return ValueText(mL) + " mL"; }),
           or_dash(session.tip_path_mm, [](double mm) { return ValueText(mm) + " mm"; }),
           TimesText(static_cast<double>(session.reversals)));
  }

  void Picture() {
    if (parts_.picture.empty()) return;
    out_ +=
        "<section class=\"whole\">\n<h2>Instruments at the end of the session</h2>\n"
        "<figure class=\"picture\">\n" +
        parts_.picture +
        "<figcaption>Left: the whole vessel from the front. Right: the surroundings of the tip. "
        "Cyan: the last 10 mm; thin white line: path of the tip; orange dots: contact "
        "with the wall.</figcaption></figure>\n</section>\n";
  }

  void Methods() {
    out_ += "<section>\n<h2>Methods of measurement</h2>\n<ul class=\"small\">\n";
    if (report_.judged) {
      out_ +=
          "<li>Measures and curves are those of a replay of the session's commands at full "
          "accuracy. They do not depend on the load of the machine.</li>\n";
    }
    if (report_.expert) {
      Append(out_,
             "<li>The expert run is the script {} in the same scene, measured in the same way. It "
             "is one good way, not the only one.</li>\n",
             SafeText(std::filesystem::path(report_.expert->file).filename().string()));
    }
    out_ +=
        "<li>Forces and pressures are those of the simulation; they have not been compared with "
        "a patient's.";
    if (figures_.summary().wall_force_mN) {
      out_ += " The largest force is that on " + figures_.Patch() +
              ". Moments before the simulation has settled do not count for it.";
    }
    Append(out_,
           "</li>\n<li>The path length of the tip is added up in steps of {:g} mm. Its speed is "
           "its straight-line distance in {:g} s, divided by that time. The tip counts as moving "
           "above {:g} mm/s.</li>\n"
           "<li>A reversal is a change of direction of the insertion by more than {:g} mm; fewer "
           "reversals are smoother. Smooth motion of the tip goes with skill: Estrada et al., IEEE "
           "Transactions on "
           "Human-Machine "
           "Systems 46(5):647, 2016.</li>\n",
           SessionCourse::kPathStepMm, SessionCourse::kSpeedWindowS, SessionCourse::kRestingMmS,
           SessionCourse::kReversalMm);
    const std::vector<InstrumentCourse>& instruments = report_.course.instruments();
    if (instruments.size() > 1) {
      out_ += "<li>Speed and drawn path of the tip are those of " + SafeText(instruments[0].name) +
              ", the innermost instrument. The path length is that of the assessed instrument, if "
              "the scene has an assessment.</li>\n";
    }
    if (figures_.Reading("log_dimensionless_jerk")) {
      out_ +=
          "<li>LDLJ is the log dimensionless jerk of the hand's speed; the nearer to zero, the "
          "smoother: Balasubramanian et al., Journal of NeuroEngineering and Rehabilitation "
          "12:112, 2015.</li>\n";
    }
    out_ +=
        "<li>Curves show the lowest and the highest value of each time interval, so no peak is "
        "lost.</li>\n</ul>\n</section>\n";
  }

  const SessionReport& report_;
  const PageParts& parts_;
  const PageFigures figures_;
  std::optional<SessionReport> expert_report_;  // of the expert run
  std::optional<PageFigures> expert_;           // refers to expert_report_
  std::string out_;
};

}  // namespace

std::string FormatPage(const SessionReport& report, const PageParts& parts) {
  return Page(report, parts).Write();
}

}  // namespace torquer
