#include "host/study/accuracy_grid.h"

#include "host/study/study.h"

namespace torquer::study {
namespace {

std::string Segment(double segment_mm) { return "segment=" + Number(segment_mm) + "mm"; }

AccuracyCase Newton(double segment_mm, double tolerance) {
  AccuracyCase c;
  c.segment_mm = segment_mm;
  c.tolerance = tolerance;
  c.name = "newton/" + Segment(segment_mm) + "/tolerance=" + Number(tolerance);
  return c;
}

AccuracyCase NewtonBudget(double segment_mm, double budget_us) {
  AccuracyCase c;
  c.segment_mm = segment_mm;
  c.method = AccuracyMethod::kNewtonBudget;
  c.budget_us = budget_us;
  c.name = "newton/" + Segment(segment_mm) + "/budget=" + Number(budget_us, 4) + "us";
  return c;
}

AccuracyCase Paper(double segment_mm, PaperCycles cycles, int count) {
  AccuracyCase c;
  c.segment_mm = segment_mm;
  c.method = AccuracyMethod::kPaper;
  c.cycles = cycles;
  c.cycle_count = count;
  c.law = BendingLaw::kG1;
  c.contact_points = 1;
  const std::string what = cycles == PaperCycles::kNone       ? "tip"
                           : cycles == PaperCycles::kPhysical ? "pr=" + std::to_string(count)
                                                              : "pr+gr=" + std::to_string(count);
  c.name = "paper/" + Segment(segment_mm) + "/" + what;
  return c;
}

AccuracyCase Named(const std::string& name, AccuracyCase c) {
  c.name = name;
  return c;
}

}  // namespace

AccuracyCase DefaultCase() { return Named("default", AccuracyCase()); }

std::vector<AccuracyCase> FrontCases(bool quick) {
  std::vector<AccuracyCase> cases = {DefaultCase()};
  const std::vector<double> segments =
      quick ? std::vector<double>{2.5, 1, 0.4} : std::vector<double>{2.5, 1, 0.4, 0.2};
  const std::vector<double> tolerances =
      quick ? std::vector<double>{1e-2, 1e-4, 1e-6, 1e-8}
            : std::vector<double>{1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9};
  const std::vector<double> budgets =
      quick ? std::vector<double>{50, 500}
            : std::vector<double>{50, 100, 200, 500, 1000, 2000, 5000};
  const std::vector<int> counts = quick ? std::vector<int>{1, 3} : std::vector<int>{1, 3, 10};
  for (const double segment_mm : segments) {
    for (const double tolerance : tolerances) cases.push_back(Newton(segment_mm, tolerance));
    for (const double budget_us : budgets) cases.push_back(NewtonBudget(segment_mm, budget_us));
    cases.push_back(Paper(segment_mm, PaperCycles::kNone, 0));
    for (const int count : counts) {
      cases.push_back(Paper(segment_mm, PaperCycles::kPhysical, count));
      cases.push_back(Paper(segment_mm, PaperCycles::kGeometrical, count));
    }
  }
  return cases;
}

std::vector<AccuracyAxis> AxisCases(bool quick) {
  std::vector<AccuracyAxis> axes;

  AccuracyAxis friction{"Friction", "coefficient of friction", false, {}, {}};
  for (const double mu : {0.0, 0.05, 0.1, 0.3}) {
    AccuracyCase c = DefaultCase();
    c.friction = mu;
    friction.x.push_back(mu);
    friction.cases.push_back(Named("friction=" + Number(mu), c));
  }
  axes.push_back(friction);

  AccuracyAxis law{"Bending law", "", false, {}, {}};
  for (const double segment_mm : {1.0, 2.5}) {
    for (const auto& [name, kind] :
         {std::pair("exact", BendingLaw::kExact), std::pair("g1", BendingLaw::kG1),
          std::pair("g2", BendingLaw::kG2)}) {
      AccuracyCase c = Newton(segment_mm, 1e-6);
      c.law = kind;
      law.cases.push_back(Named(std::string("law=") + name + "/" + Segment(segment_mm), c));
    }
  }
  axes.push_back(law);

  AccuracyAxis points{"Contact points of a segment", "contact points of a segment", false, {}, {}};
  for (const int count : {1, 2, 4, 8}) {
    AccuracyCase c = DefaultCase();
    c.contact_points = count;
    points.x.push_back(count);
    points.cases.push_back(Named("points=" + std::to_string(count), c));
  }
  axes.push_back(points);

  AccuracyAxis field{"Field", "", false, {}, {}};
  const auto add_field = [&field](const std::string& name, FieldKind kind, double voxel_mm) {
    AccuracyCase c = DefaultCase();
    c.field = kind;
    c.voxel_mm = voxel_mm;
    c.against_finest_field = true;
    field.cases.push_back(Named(name, c));
  };
  add_field("field=shipped", FieldKind::kScene, 0);
  for (const double voxel : {1.0, 0.5, 0.25}) {
    if (quick && voxel == 0.25) continue;
    add_field("field=spline/voxel=" + Number(voxel) + "mm", FieldKind::kSpline, voxel);
  }
  add_field("field=linear/voxel=0.5mm", FieldKind::kTrilinear, 0.5);
  axes.push_back(field);

  AccuracyAxis rule{"Update rule of the paper's method", "", false, {}, {}};
  for (const auto& [name, kind] :
       {std::pair("16", UpdateRule::kSigned), std::pair("17", UpdateRule::kRhoOnly),
        std::pair("19", UpdateRule::kAbsolute), std::pair("exact", UpdateRule::kExactRoot)}) {
    AccuracyCase c = Paper(1, PaperCycles::kGeometrical, 1);
    c.rule = kind;
    rule.cases.push_back(Named(std::string("rule=") + name, c));
  }
  axes.push_back(rule);
  return axes;
}

}  // namespace torquer::study
