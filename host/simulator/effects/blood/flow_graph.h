// Flow graph: the centerline network as a graph of pipes, and the flow of a viscous fluid in it.
//
//     inlet o---->----o joint --->---o outlet     edges: stretches of curves between joints
//                      \--->---o outlet           nodes: joints and free ends
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "host/simulator/vessel/centerline.h"

namespace torquer::effects {

/// Edge: a stretch of a curve between two nodes, without a joint in between.
struct FlowEdge {
  std::size_t curve = 0;
  double from_mm = 0, to_mm = 0;  ///< arc lengths on the curve, from < to
  int a = 0, b = 0;               ///< nodes at from_mm and to_mm; flow is positive from a to b
  double length_mm() const { return to_mm - from_mm; }
};

struct FlowNode {
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
  std::vector<int> edges;
  /// The only place of a free end; the first place of a joint.
  vessel::CenterlinePlace place;
  bool is_end() const { return edges.size() == 1; }
};

class FlowGraph {
 public:
  /// The network must outlive the graph. Throws UserError naming the curve if a radius is 0.
  explicit FlowGraph(const vessel::CenterlineNetwork& network);

  const vessel::CenterlineNetwork& network() const { return *network_; }
  const std::vector<FlowNode>& nodes() const { return nodes_; }
  const std::vector<FlowEdge>& edges() const { return edges_; }

  /// Node at an end ("start" or "end") of a curve. Throws UserError for unknown names.
  int NodeAt(const std::string& curve, const std::string& end) const;
  /// Index of the edge that contains a place of the network.
  int EdgeAt(const vessel::CenterlinePlace& place) const;
  /// Name of a node, as in "curve_14" end.
  std::string NameOf(int node) const;
  /// Nodes connected to a node along edges: true for each reached node. `closed`: an edge that
  /// nothing passes; -1 for none.
  std::vector<bool> ReachedFrom(int node, int closed = -1) const;
  /// Number of the connected part of each node, from 0 in the order of the nodes.
  std::vector<int> Parts() const;

  /// Integral of 1/r^4 over part of a curve, 1/mm^3. Times 8 mu/pi it is Poiseuille's resistance.
  double InverseFourthPower(std::size_t curve, double from_mm, double to_mm) const;
  /// Volume of a part of a curve's lumen, mm^3.
  double VolumeMm3(std::size_t curve, double from_mm, double to_mm) const;

 private:
  const vessel::CenterlineNetwork* network_;
  std::vector<FlowNode> nodes_;
  std::vector<FlowEdge> edges_;
};

/// Boundary condition at a free end.
struct FlowEnd {
  int node = 0;
  bool is_pressure = false;  ///< true: pressure_mmHg acts at the end itself
  double pressure_mmHg = 0;  ///< otherwise behind the resistance
  double resistance_mmHg_s_mL = 0;
  // Windkessel, which has a resistance too:
  //
  //   end --[ proximal ]--+--[ resistance ]-- pressure
  //                       = compliance
  double compliance_mL_mmHg = 0;  ///< 0: no Windkessel
  double proximal_mmHg_s_mL = 0;  ///< >= 0
  double systolic_mmHg = 0;       ///< added to the distal pressure at the peak of the ejection
};

/// Equilibrium pressures and flows of a graph, linear in the inputs.
class FlowSolution {
 public:
  /// resistance: one per edge, > 0. Every node must be connected to one of the ends.
  FlowSolution(const FlowGraph& graph, std::vector<double> resistance_mmHg_s_mL,
               std::vector<FlowEnd> ends);
  /// Copy of `twin` for its graph, which is now at another address.
  FlowSolution(const FlowSolution& twin, const FlowGraph& graph)
      : graph_(graph),
        resistance_(twin.resistance_),
        ends_(twin.ends_),
        unknown_(twin.unknown_),
        inverse_(twin.inverse_) {}

  struct Flows {
    std::vector<double> edge_mL_s;      ///< from a to b
    std::vector<double> pressure_mmHg;  ///< of each node
    std::vector<double> end_mL_s;       ///< out of the network, one entry per end
  };
  /// Solves for the flows with `inflow_mL_s` into each node and the given pressure of each end. The
  /// pressure acts at the end itself or behind its resistances. The compliance of an end takes no
  /// flow.
  Flows Solve(const std::vector<double>& inflow_mL_s,
              const std::vector<double>& end_pressure_mmHg) const;

  const std::vector<FlowEnd>& ends() const { return ends_; }
  const std::vector<double>& resistance_mmHg_s_mL() const { return resistance_; }

 private:
  const FlowGraph& graph_;
  std::vector<double> resistance_;
  std::vector<FlowEnd> ends_;
  std::vector<int> unknown_;  // of each node; -1 for a given pressure
  Eigen::MatrixXd inverse_;
};

}  // namespace torquer::effects
