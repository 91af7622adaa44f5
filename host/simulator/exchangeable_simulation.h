// A simulation whose instruments can be exchanged while it runs.
#pragma once

#include <memory>
#include <string>
#include <torquer_lcm/devices_t.hpp>

#include "host/simulator/effect_prices.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"

namespace torquer::simulator {

/// Owns a simulation, and replaces it and its scene at each exchange. References to either are
/// valid until the next exchange.
class ExchangeableSimulation {
 public:
  /// `scene` is the one at the start. It and `prices` (see Simulation) must outlive this.
  explicit ExchangeableSimulation(scene::Scene& scene, EffectPrices* prices = nullptr)
      : scene_at_start_(scene), simulation_(std::make_unique<Simulation>(scene, prices)) {}

  Simulation& now() { return *simulation_; }
  const Simulation& now() const { return *simulation_; }
  const scene::Scene& scene_at_start() const { return scene_at_start_; }

  /// Exchanges an instrument for a device of the library; its state and those of the others stay.
  /// Throws UserError naming the remedy, without effect, if that is not possible now. No picture
  /// may be rendered meanwhile.
  void Exchange(int instrument, const std::string& device);
  /// Repeats an exchange of a recording. Throws UserError as above, or if the device's values have
  /// changed since.
  void Repeat(const DeviceExchange& recorded);

 private:
  scene::Scene& scene_at_start_;
  std::unique_ptr<scene::Scene> scene_;  // null before the first exchange
  std::unique_ptr<Simulation> simulation_;
};

/// Devices of the instruments, and their exchanges.
torquer_lcm::devices_t DescribeDevices(const Simulation& simulation, const std::string& refusal);
/// Exchanges in a message. Throws UserError if it has impossible values.
std::vector<DeviceExchange> ReadExchanges(const torquer_lcm::devices_t& message);

}  // namespace torquer::simulator
