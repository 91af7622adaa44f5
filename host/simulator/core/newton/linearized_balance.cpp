#include "host/simulator/core/newton/linearized_balance.h"

#include <cstddef>

namespace torquer {

void ReplaceGradients(const CurveStep& gradient, CurveQuadraticModel& model) {
  for (std::size_t i = 0; i < model.joints.size(); ++i) {
    model.joints[i].gradient_proximal.setZero();
    model.joints[i].gradient_distal = gradient.xi[i];
  }
  for (std::size_t i = 0; i < model.twists.size(); ++i) {
    model.twists[i].gradient_proximal = 0;
    model.twists[i].gradient_distal = gradient.spin[i];
  }
  if (!model.stack.empty()) {
    const std::size_t spins = gradient.spin.size() / model.stack.size();
    for (std::size_t i = 0; i < model.stack.size(); ++i) {
      model.stack[i].gradient_proximal.setZero();
      for (std::size_t k = 0; k < spins; ++k) {
        model.stack[i].gradient_distal[static_cast<Eigen::Index>(k)] = gradient.spin[i * spins + k];
      }
    }
  }
  for (LoadTerms& load : model.loads) {
    load.g0.setZero();
    load.g1.setZero();
  }
}

}  // namespace torquer
