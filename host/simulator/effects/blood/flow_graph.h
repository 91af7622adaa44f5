// The centerline network as a graph of pipes, and the flow of a viscous fluid in it.
//
//     inlet o---->----o joint --->---o outlet     edges: stretches of curves between joints
//                      \--->---o outlet           nodes: joints and free ends
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "host/simulator/vessel/centerline.h"

namespace torquer::effects {

/// A stretch of a curve between two nodes, with nothing joined in between.
struct FlowEdge {
  std::size_t curve = 0;
  double from_mm = 0, to_mm = 0;  ///< arc lengths on the curve, from < to
  int a = 0, b = 0;               ///< nodes at from_mm and to_mm; flow is positive from a to b
  double length_mm() const { return to_mm - from_mm; }
};

struct FlowNode {
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
  std::vector<int> edges;
  /// The only place of a free end; of a joint the first.
  vessel::CenterlinePlace place;
  bool is_end() const { return edges.size() == 1; }
};

class FlowGraph {
 public:
  /// The network must outlive the graph. Throws UserError naming the curve where a radius is 0.
  explicit FlowGraph(const vessel::CenterlineNetwork& network);

  const vessel::CenterlineNetwork& network() const { return *network_; }
  const std::vector<FlowNode>& nodes() const { return nodes_; }
  const std::vector<FlowEdge>& edges() const { return edges_; }

  /// The node at an end ("start" or "end") of a curve. Throws UserError for unknown names.
  int NodeAt(const std::string& curve, const std::string& end) const;
  /// The edge that holds a place of the network, and the arc length on its curve.
  int EdgeAt(const vessel::CenterlinePlace& place) const;
  /// "curve_14 end"
  std::string NameOf(int node) const;
  /// Whether there is a way along edges from a node to each node.
  std::vector<bool> ReachedFrom(int node) const;

  /// Integral of 1/r^4 over part of a curve, 1/mm^3: times 8 mu/pi the resistance of Poiseuille.
  double InverseFourthPower(std::size_t curve, double from_mm, double to_mm) const;
  /// Volume of a part of a curve's lumen, mm^3.
  double VolumeMm3(std::size_t curve, double from_mm, double to_mm) const;

 private:
  const vessel::CenterlineNetwork* network_;
  std::vector<FlowNode> nodes_;
  std::vector<FlowEdge> edges_;
};

/// What happens at a free end.
struct FlowEnd {
  int node = 0;
  bool is_pressure = false;  ///< pressure_mmHg holds at the end itself
  double pressure_mmHg = 0;  ///< else: behind the resistance
  double resistance_mmHg_s_mL = 0;
  // Of a Windkessel, which has a resistance too:
  //
  //   end --[ proximal ]--+--[ resistance ]-- pressure
  //                       = compliance
  double compliance_mL_mmHg = 0;  ///< 0: none
  double proximal_mmHg_s_mL = 0;  ///< >= 0
  double systolic_mmHg = 0;       ///< added to the pressure behind at the height of the ejection
};

/// Pressures and flows that a graph takes in equilibrium. Linear in what goes in.
class FlowSolution {
 public:
  /// resistance: one an edge, > 0. Every node must be reached from one of the ends.
  FlowSolution(const FlowGraph& graph, std::vector<double> resistance_mmHg_s_mL,
               std::vector<FlowEnd> ends);
  /// `twin`, on the same graph at another place.
  FlowSolution(const FlowSolution& twin, const FlowGraph& graph)
      : graph_(graph),
        resistance_(twin.resistance_),
        ends_(twin.ends_),
        unknown_(twin.unknown_),
        inverse_(twin.inverse_) {}

  struct Flows {
    std::vector<double> edge_mL_s;      ///< from a to b
    std::vector<double> pressure_mmHg;  ///< of each node
    std::vector<double> end_mL_s;       ///< out of the network, one for each of the ends
  };
  /// What flows where `inflow_mL_s` goes in at each node and each of the ends has this pressure, at
  /// itself or behind its resistances (the compliance of an end takes nothing).
  Flows Solve(const std::vector<double>& inflow_mL_s,
              const std::vector<double>& end_pressure_mmHg) const;

  const std::vector<FlowEnd>& ends() const { return ends_; }
  const std::vector<double>& resistance_mmHg_s_mL() const { return resistance_; }

 private:
  const FlowGraph& graph_;
  std::vector<double> resistance_;
  std::vector<FlowEnd> ends_;
  std::vector<int> unknown_;  // of each node; -1 where the pressure is given
  Eigen::MatrixXd inverse_;
};

}  // namespace torquer::effects
