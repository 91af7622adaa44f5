#include "host/tools/calibrate_report.h"

#include <catch2/catch.hpp>
#include <numbers>

namespace {

using Catch::Contains;
using namespace torquer::calibration;
using torquer::tools::Grade;
using torquer::tools::GradeOf;

constexpr double kGain = 0.02;
constexpr double kTurn = 4.0 * std::numbers::pi;

// Four pushes with a scatter of 0.4 mm, one refused push, and three exact strokes of turns.
ProcedureResult Sample(double scatter_mm = 0.4) {
  ProcedureResult result;
  const auto add = [&](MotionKind kind, double mm, double rad, const Rejection& rejection) {
    RecordedStroke recorded;
    recorded.stroke.kind = kind;
    recorded.stroke.reference = kind == MotionKind::kPush ? 150.0 : kTurn;
    recorded.stroke.axial_counts = mm / kGain;
    recorded.stroke.transverse_counts = 5.0 * rad / kGain;
    result.strokes.push_back(recorded);
    result.rejections.push_back(rejection);
  };
  add(MotionKind::kPush, 150.0 + scatter_mm, 0.0, {});
  add(MotionKind::kPush, 70.0, 0.0, "too short");
  add(MotionKind::kPush, 150.0 - scatter_mm, 0.0, {});
  add(MotionKind::kPush, 150.0 + scatter_mm, 0.0, {});
  add(MotionKind::kPush, 150.0 - scatter_mm, 0.0, {});
  for (int i = 0; i < 3; ++i) add(MotionKind::kTurn, 0.0, kTurn, {});
  std::vector<Stroke> good;
  for (std::size_t i = 0; i < result.strokes.size(); ++i) {
    if (!result.rejections[i]) good.push_back(result.strokes[i].stroke);
  }
  result.fit = FitMotion(good, {}, 1200);
  return result;
}

std::size_t Count(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

}  // namespace

TEST_CASE("Parameters are reported with standard errors and intervals") {
  const std::string table = torquer::tools::ParameterTable(Sample());
  CHECK_THAT(table, Contains("gain                20.0000 um a count"));
  // 0.4 mm times sqrt(4 / 3), for one of four pushes of 150 mm: 0.154 %; t(3) = 3.182.
  CHECK_THAT(table, Contains("standard error 0.0308, 95 % within 0.0979"));
  CHECK_THAT(table, Contains("cylinder radius      5.0000 mm"));
  ProcedureResult drifting = Sample();
  drifting.return_mm = 3.5;
  drifting.mean_surface_quality = 61.0;
  CHECK_THAT(torquer::tools::ParameterTable(drifting),
             Contains("began +3.50 mm from the first at last; surface quality 61"));
  CHECK_THAT(torquer::tools::Verdict(drifting, {}), Contains("The near end moved by 3.5 mm"));
  CHECK_THAT(torquer::tools::Verdict(Sample(), {}), !Contains("The near end moved"));
}

TEST_CASE("Residuals are drawn stroke by stroke, by their number in the run") {
  const std::string chart = torquer::tools::ResidualChart(Sample(), 80);
  CHECK_THAT(chart, Contains("push      -0.5         0 mm    +0.5 "));
  CHECK_THAT(chart, Contains("\n       1   |  *        :           |  -0.40 "));
  CHECK_THAT(chart, Contains("\n       3   |           :        *  |  +0.40 "));
  CHECK(Count(chart, "\n       2   ") == 1);  // of the turns
  CHECK(Count(chart, "\n") == 2 + 4 + 3);
  for (const int columns : {20, 60, 200}) {
    CHECK(Count(torquer::tools::ResidualChart(Sample(), columns), "\n") == 9);
  }
}

TEST_CASE("The picture holds a mark for each stroke that was used") {
  const std::string picture = torquer::tools::ResidualPicture(Sample(), "Calibration of <A&B>");
  CHECK(picture.starts_with("<svg "));
  CHECK(picture.ends_with("</svg>\n"));
  CHECK(Count(picture, "<svg ") == Count(picture, "</svg>"));
  CHECK(Count(picture, "<circle ") == 2 * (4 + 3));
  CHECK_THAT(picture, Contains("Calibration of &lt;A&amp;B"));
  CHECK_THAT(picture, Contains("Pushes: unwanted turning") && Contains("Turns: rotation"));
}

TEST_CASE("The verdict is in plain words, with the remedy") {
  ProcedureSettings settings;
  CHECK(GradeOf(Sample().fit) == Grade::kGood);
  CHECK_THAT(torquer::tools::Verdict(Sample(), settings),
             Contains("A push of 150 mm is measured to within 0.7") && Contains("That is good."));
  CHECK(GradeOf(Sample(2.0).fit) == Grade::kUsable);
  CHECK_THAT(torquer::tools::Verdict(Sample(2.0), settings),
             Contains("That is usable.") && Contains("The pushes scatter by 2.31 mm"));
  CHECK(GradeOf(Sample(9.0).fit) == Grade::kPoor);
  CHECK_THAT(torquer::tools::Verdict(Sample(9.0), settings), Contains("it is not saved"));

  ProcedureResult declared = Sample(0.1);
  std::vector<Stroke> good;
  for (std::size_t i = 0; i < declared.strokes.size(); ++i) {
    if (!declared.rejections[i]) good.push_back(declared.strokes[i].stroke);
  }
  declared.fit = FitMotion(good, {.push_mm = 2.0}, 1200);
  settings.length_error_mm = 2.0;
  CHECK_THAT(torquer::tools::Verdict(declared, settings),
             Contains("Most of the error of a push is that of the declared length"));
}
