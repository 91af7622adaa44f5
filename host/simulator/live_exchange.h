// Exchanges instruments of a scene that runs live.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host/bus/bus.h"
#include "host/simulator/exchangeable_simulation.h"
#include "host/simulator/live_commands.h"
#include "host/simulator/picture_thread.h"

namespace torquer::simulator {

/// Executes orders, and publishes the devices of the instruments.
class LiveExchange {
 public:
  /// All arguments must outlive this.
  LiveExchange(ExchangeableSimulation& simulation,
               const std::vector<std::unique_ptr<PictureThread>>& pictures, bus::Bus& bus)
      : simulation_(simulation), pictures_(pictures), bus_(bus) {}

  /// Executes an order, or refuses it with a reason. Waits for pictures that are being rendered.
  /// Publishes the result, and returns it as a sentence for the simulator's health.
  std::string Execute(const ExchangeOrder& order);
  /// Publishes devices_t. Call it at the start and once a second.
  void Publish();

 private:
  std::string Refusal(const ExchangeOrder& order);

  ExchangeableSimulation& simulation_;
  const std::vector<std::unique_ptr<PictureThread>>& pictures_;
  bus::Bus& bus_;
  std::string refusal_;  // of the newest order; "" if it was executed
};

}  // namespace torquer::simulator
