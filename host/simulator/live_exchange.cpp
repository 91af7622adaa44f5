#include "host/simulator/live_exchange.h"

#include <fmt/format.h>

#include "host/support/error.h"
#include "host/support/printable_text.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

// Executes the order and returns "", or returns the reason against it.
std::string LiveExchange::Refusal(const ExchangeOrder& order) {
  if (simulation_.now().exchanges().size() >= protocol::kMostExchanges) {
    return fmt::format("the session has {} exchanges, and cannot have more; start another session",
                       protocol::kMostExchanges);
  }
  try {
    simulation_.Exchange(order.instrument, order.device);
  } catch (const UserError& error) {
    return Printable(error.what(), 300);
  }
  return "";
}

std::string LiveExchange::Execute(const ExchangeOrder& order) {
  for (const std::unique_ptr<PictureThread>& pictures : pictures_) pictures->Pause();
  refusal_ = Refusal(order);
  for (std::size_t k = 0; k < pictures_.size(); ++k) {
    pictures_[k]->Continue(*simulation_.now().image(k));
  }
  Publish();
  if (!refusal_.empty()) return refusal_;
  const auto k = static_cast<std::size_t>(order.instrument);
  return fmt::format("the {} is the device {} now", simulation_.now().scene().instruments()[k].name,
                     order.device);
}

void LiveExchange::Publish() {
  bus_.Publish(protocol::kDevicesChannel, DescribeDevices(simulation_.now(), refusal_));
}

}  // namespace torquer::simulator
