#include "host/simulator/exchangeable_simulation.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <utility>

#include "host/support/error.h"
#include "host/support/fnv1a.h"
#include "host/support/printable_text.h"

namespace torquer::simulator {

void ExchangeableSimulation::Exchange(int instrument, const std::string& device) {
  simulation_->CheckExchange(instrument);
  auto scene = simulation_->scene().WithDevice(instrument, device);
  auto next = std::make_unique<Simulation>(*scene, *simulation_, instrument);
  simulation_ = std::move(next);  // before its scene
  scene_ = std::move(scene);
}

void ExchangeableSimulation::Repeat(const DeviceExchange& recorded) {
  const auto& instruments = simulation_->scene().instruments();
  if (recorded.instrument < 0 || recorded.instrument >= static_cast<int>(instruments.size())) {
    throw UserError(fmt::format("the recording exchanges instrument {}, and the scene has {}",
                                recorded.instrument, instruments.size()));
  }
  Exchange(recorded.instrument, recorded.device);
  const std::uint64_t hash = simulation_->scene().content_hash();
  if (hash == recorded.content_hash) return;
  throw UserError(
      fmt::format("the device {} has other values than in the recording ({}, then {}); give the "
                  "devices of the recording",
                  recorded.device, Hex(hash), Hex(recorded.content_hash)));
}

torquer_lcm::devices_t DescribeDevices(const Simulation& simulation, const std::string& refusal) {
  torquer_lcm::devices_t out{};
  for (const scene::InstrumentSpec& instrument : simulation.scene().spec().instruments) {
    out.instruments.push_back(instrument.name);
    out.devices.push_back(instrument.device);
  }
  out.instrument_count = static_cast<std::int32_t>(out.instruments.size());
  for (const DeviceExchange& exchange : simulation.exchanges()) {
    out.exchange_tick.push_back(exchange.tick);
    out.exchange_time_s.push_back(exchange.time_s);
    out.exchange_instrument.push_back(exchange.instrument);
    out.exchange_device.push_back(exchange.device);
    out.exchange_hash.push_back(Hex(exchange.content_hash));
  }
  out.exchange_count = static_cast<std::int32_t>(out.exchange_tick.size());
  out.refusal = refusal;
  return out;
}

std::vector<DeviceExchange> ReadExchanges(const torquer_lcm::devices_t& message) {
  std::vector<DeviceExchange> all;
  for (std::size_t k = 0; k < message.exchange_tick.size(); ++k) {
    const std::string& hex = message.exchange_hash[k];
    DeviceExchange exchange{.tick = message.exchange_tick[k],
                            .time_s = message.exchange_time_s[k],
                            .instrument = message.exchange_instrument[k],
                            .device = message.exchange_device[k]};
    const auto [end, error] =
        std::from_chars(hex.data(), hex.data() + hex.size(), exchange.content_hash, 16);
    const bool ascends = all.empty() || exchange.tick >= all.back().tick;
    if (error != std::errc() || end != hex.data() + hex.size() || !ascends || exchange.tick < 0 ||
        !std::isfinite(exchange.time_s)) {
      throw UserError(fmt::format(
          "the exchange for the device '{}' has impossible values: tick "
          "{}, {:g} s, hash '{}'; the recording is damaged",
          Printable(exchange.device, 40), exchange.tick, exchange.time_s, Printable(hex, 40)));
    }
    all.push_back(std::move(exchange));
  }
  return all;
}

}  // namespace torquer::simulator
