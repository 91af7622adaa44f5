#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "host/simulator/core/bending.h"
#include "host/study/paper_bench.h"
#include "host/study/paper_parts.h"

namespace torquer::study {
namespace {

// Fig. 16: contacts for each wall stiffness. The plot shows the first, which is the phantom's.
PaperBench::Bouncing MeasureWalls(PaperPart& part, int settle) {
  // The growth of the updates with wall stiffness shows their cause.
  constexpr double kWalls[] = {0.01, 0.1, 1};
  PaperBench::Bouncing seen;
  Table table{"Bouncing and the wall's stiffness, n = 250",
              {"wall, N/mm^2", "largest mean |du|", "of segment", "contacts at a time"},
              {}};
  for (const double wall : kWalls) {
    PaperBench bench(part.phantom,
                     {.segment_mm = 1, .tip_angle_rad = kPaperTipRad, .wall_N_mm2 = wall});
    bench.InsertFast();
    for (int k = 0; k < settle; ++k) {
      part.run.Progress("contacts", 0.85 + 0.02 * wall + 0.0005 * k);
      bench.Cycle(true);
    }
    PaperBench::Bouncing now = bench.Observe(part.run.quick() ? 3 : 20);
    const auto largest = std::max_element(now.mean_update.begin(), now.mean_update.end());
    const auto segment = static_cast<int>(largest - now.mean_update.begin()) + 1;
    double contacts = 0;
    for (const double share : now.contact_share) contacts += share;
    const std::string name = "figure16/wall=" + Number(wall);
    if (wall == kWalls[0]) {
      part.comparison.Add(
          "largest mean update |du| of a segment (Fig. 16)", name, "largest_mean_update", 9.2e-3,
          *largest, "",
          "the stiffness of the wall, which the paper does not give; see this section");
    } else {
      part.run.Record(name, "largest_mean_update", *largest, "");
    }
    part.run.Record(name, "segment_of_largest_update", segment, "");
    part.run.Record(name, "mean_contacts", contacts, "");
    table.rows.push_back(
        {Number(wall), Number(*largest), std::to_string(segment), Number(contacts)});
    if (wall == kWalls[0]) seen = std::move(now);
  }
  return seen;
}

void DrawContacts(PaperPart& part, const PaperBench::Bouncing& seen, int settle) {
  const double touched = static_cast<double>(std::count_if(
      seen.contact_share.begin(), seen.contact_share.end(), [](double s) { return s > 0; }));
  part.run.Record("figure16/wall=0.01", "nodes_ever_in_contact", touched, "");
  Plot contacts;
  contacts.title = "Time in contact (Fig. 16)";
  contacts.x.label = "node";
  contacts.y = {"fraction of the time, %", false, std::pair{0.0, 100.0}};
  contacts.height = 300;
  Series bars{"", Mark::kBars, {}, {}, {}, 1};
  for (std::size_t j = 0; j < seen.contact_share.size(); ++j) {
    bars.x.push_back(static_cast<double>(j));
    bars.y.push_back(100 * seen.contact_share[j]);
  }
  contacts.series.push_back(bars);
  part.run.Draw(
      contacts,
      "After " + std::to_string(settle) + " cycles at n = 250 and 0.01 N/mm^2: " + Number(touched) +
          " nodes touch the wall at some time, most of them only temporarily, as in the paper.");
}

void DrawUpdates(PaperPart& part, const PaperBench::Bouncing& seen) {
  Plot updates;
  updates.title = "Mean update of the unit vectors in a PR cycle (Fig. 16)";
  updates.x.label = "segment";
  updates.y = {"mean |du|", true, {}};
  updates.height = 300;
  Series line{"", Mark::kLine, {}, {}, {}, 6};
  for (std::size_t i = 0; i < seen.mean_update.size(); ++i) {
    line.x.push_back(static_cast<double>(i + 1));
    line.y.push_back(seen.mean_update[i]);
  }
  updates.series.push_back(line);
  part.run.Draw(updates,
                "Updates decrease distally of each contact, because its force is no longer in the "
                "sum (9). They never vanish: a PR step considers only the bending stiffness, so it "
                "overshoots where k lambda^3 N > 4 EI/lambda.");
}

void MeasureBouncing(PaperPart& part) {
  part.run.Section("Contact with the wall (4.4, Fig. 16)");
  const int settle = part.run.quick() ? 40 : 100;
  const PaperBench::Bouncing seen = MeasureWalls(part, settle);
  DrawContacts(part, seen, settle);
  DrawUpdates(part, seen);
}

// Compares the bending laws (Fig. 17).
void CompareBendingLaws(PaperPart& part) {
  part.run.Section("Bending laws (4.5, Fig. 17)");
  Plot plot;
  plot.title = "Bending energy of a joint (Fig. 17)";
  plot.x.label = "angle, rad";
  plot.y.label = "g";
  for (const auto& [law, label] : {std::pair{BendingLaw::kExact, "exact: theta sin(theta/2)"},
                                   {BendingLaw::kG1, "g1 (Baier et al. 2016)"},
                                   {BendingLaw::kG2, "g2 (Alderliesten et al. 2004)"}}) {
    Series series{label, law == BendingLaw::kExact ? Mark::kLine : Mark::kDashed, {}, {}};
    for (int k = 0; k <= 100; ++k) {
      const double theta = std::numbers::pi / 2 * k / 100;
      series.x.push_back(theta);
      series.y.push_back(EvaluateBending(law, 2 * std::pow(std::sin(theta / 2), 2)).g);
    }
    plot.series.push_back(series);
  }
  part.run.Draw(plot,
                "Up to 0.1 rad the three laws agree; at 1 rad only g1 is close to the exact law.");
  const double y = 2 * std::pow(std::sin(0.05), 2);
  const double exact = EvaluateBending(BendingLaw::kExact, y).g;
  const auto error = [&](BendingLaw law) {
    return 100 * std::abs(EvaluateBending(law, y).g / exact - 1);
  };
  part.comparison.Add("error of g1 at 0.1 rad (Fig. 17)", "figure17", "g1_error", 4.7e-5,
                      error(BendingLaw::kG1), "%", "none: a formula");
  part.comparison.Add("error of g2 at 0.1 rad (Fig. 17)", "figure17", "g2_error", 0.29,
                      error(BendingLaw::kG2), "%", "none: a formula");
}

// Angles of joints that are straight at rest, degrees.
struct Angles {
  double mean = 0;
  double largest = 0;
};

Angles AnglesOf(const WireModel& model, const WireState& state) {
  Angles angles;
  int count = 0;
  for (int i = 1; i < state.segments(); ++i) {
    if (state.segments() - i < model.first_straight_joint()) break;
    const double chord = (state.tangents()[i] - state.tangents()[i - 1]).norm();
    const double theta = 2 * std::asin(std::min(1.0, chord / 2)) * 180 / std::numbers::pi;
    angles.mean += theta;
    angles.largest = std::max(angles.largest, theta);
    ++count;
  }
  angles.mean /= count;
  return angles;
}

// Section 4.5: PR cycles from the same shape by three laws. They are g1, the predecessor's g2, and
// g2 with its signed denominator.
struct LawComparison {
  int cycles = 0;
  double distance_mm = 0;     // distance of the wires with g1 and g2
  double predecessor_mm = 0;  // distance of g1 from g2 with the signed denominator
  double restless_mm = 0;     // motion with g1 in the last quarter of the cycles
  double equilibria_mm = 0;   // distance of Newton's equilibria with g1 and g2
  Angles angles;
};

LawComparison CompareLaws(PaperPart& part, double lambda, double progress) {
  const bool quick = part.run.quick();
  const int settle = lambda < 1 ? (quick ? 8 : 60) : 100;
  LawComparison result;
  result.cycles = lambda < 1 ? (quick ? 4 : 40) : (quick ? 40 : 200);
  PhysicalSettings signed_unbounded;
  signed_unbounded.rule = UpdateRule::kSigned;
  signed_unbounded.max_update = std::numeric_limits<double>::infinity();
  PaperBench ours(part.phantom, {.segment_mm = lambda, .tip_angle_rad = kPaperTipRad});
  PaperBench other_law(
      part.phantom, {.segment_mm = lambda, .tip_angle_rad = kPaperTipRad, .law = BendingLaw::kG2});
  PaperBench theirs(part.phantom, {.segment_mm = lambda,
                                   .tip_angle_rad = kPaperTipRad,
                                   .law = BendingLaw::kG2,
                                   .physical = signed_unbounded});
  ours.InsertFast();
  for (int c = 0; c < settle; ++c) {
    part.run.Progress("g1 and g2 at " + CaseOf(lambda), progress + 0.01 * c / settle);
    ours.Cycle(true);
  }
  other_law.SetShape(ours.state());
  theirs.SetShape(ours.state());
  WireState before = ours.state();
  for (int c = 0; c < result.cycles; ++c) {
    part.run.Progress("g1 and g2 at " + CaseOf(lambda), progress + 0.01 + 0.02 * c / result.cycles);
    if (c == result.cycles - result.cycles / 4) before = ours.state();
    ours.Cycle(false);
    other_law.Cycle(false);
    theirs.Cycle(false);
  }
  result.distance_mm = MeanDistance(ours.state(), other_law.state());
  result.predecessor_mm = MeanDistance(ours.state(), theirs.state());
  result.restless_mm = MeanDistance(ours.state(), before);
  result.angles = AnglesOf(ours.model(), ours.state());
  const WireState equilibrium = ours.Equilibrium(nullptr);
  other_law.SetShape(equilibrium);
  result.equilibria_mm = MeanDistance(equilibrium, other_law.Equilibrium(nullptr));
  return result;
}

void CompareEquilibria(PaperPart& part) {
  struct Paper {
    double distance, mean_deg, largest_deg;
  };
  constexpr Paper kPaper[] = {{0.121, 4.7, 13.6}, {0.052, 1.9, 6.7}, {0.010, 0.75, 2.9}};
  Table table{"Wires relaxed with g1 and with g2 from the same shape (4.5)",
              {"n", "PR cycles", "distance, mm", "drift of PR, mm", "equilibria (Newton), mm",
               "predecessor, mm", "mean angle, deg", "largest, deg"},
              {}};
  for (std::size_t k = 0; k < 3; ++k) {
    const double lambda = kPaperSegmentsMm[k];
    const LawComparison c = CompareLaws(part, lambda, 0.91 + 0.03 * static_cast<double>(k));
    const std::string n = CaseOf(lambda).substr(2);
    const std::string name = "section4.5/" + CaseOf(lambda);
    part.comparison.Add("distance of g1 and g2, n = " + n, name, "distance", kPaper[k].distance,
                        c.distance_mm, "mm", "PR does not converge; see this section");
    part.run.Record(name, "distance_of_equilibria", c.equilibria_mm, "mm");
    part.run.Record(name, "distance_of_pr_from_itself", c.restless_mm, "mm");
    part.run.Record(name, "distance_of_predecessor", c.predecessor_mm, "mm");
    part.comparison.Add("mean angle, n = " + n, name, "mean_angle", kPaper[k].mean_deg,
                        c.angles.mean, "deg", "different bends of the artery");
    part.comparison.Add("largest angle, n = " + n, name, "largest_angle", kPaper[k].largest_deg,
                        c.angles.largest, "deg", "different bends of the artery");
    table.rows.push_back({n, std::to_string(c.cycles), Number(c.distance_mm), Number(c.restless_mm),
                          Number(c.equilibria_mm), Number(c.predecessor_mm), Number(c.angles.mean),
                          Number(c.angles.largest)});
  }
  part.run.Show(table);
  part.run.Say(
      "\"Drift of PR\" is the motion of the wire with g1 in the last quarter of its cycles. "
      "Distances of this size come from the unconverged PR, not from the bending law. Newton's "
      "equilibria show the effect of the law alone at these angles. \"Predecessor\": g2 with the "
      "signed denominator (16) and without the bound (18). It diverges where the contacts are "
      "stiff for the segment, because nothing limits its steps. Angles are those of joints that "
      "are straight at rest.");
}

}  // namespace

void MeasurePaperShapes(PaperPart& part) {
  MeasureBouncing(part);
  CompareBendingLaws(part);
  CompareEquilibria(part);
}

}  // namespace torquer::study
