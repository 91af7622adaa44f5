#include "host/recorder/session_log.h"

#include <lcm/lcm-cpp.hpp>
#include <map>

#include "host/support/error.h"
#include "protocol/lcm_channels.h"

namespace torquer {
namespace {

using RawHandler = std::function<bool(const lcm::LogEvent&)>;

template <class Message>
void Register(std::map<std::string, RawHandler>& handlers, const char* channel,
              const std::function<void(const Message&)>& handle) {
  if (!handle) return;
  handlers[channel] = [&handle](const lcm::LogEvent& event) {
    Message message;
    if (message.decode(event.data, 0, event.datalen) != event.datalen) return false;
    handle(message);
    return true;
  };
}

}  // namespace

SessionLogSummary ReadSessionLog(const std::string& path, const SessionHandlers& handlers) {
  lcm::LogFile log(path, "r");
  if (!log.good()) {
    throw UserError(path + ": cannot be read; give the file that lcm-logger wrote");
  }
  std::map<std::string, RawHandler> by_channel;
  Register(by_channel, protocol::kDeviceSampleChannel, handlers.sample);
  Register(by_channel, protocol::kInstrumentCommandChannel, handlers.command);
  Register(by_channel, protocol::kWireStateChannel, handlers.state);
  Register(by_channel, protocol::kSceneChannel, handlers.scene);
  Register(by_channel, protocol::kReadingsChannel, handlers.readings);
  Register(by_channel, protocol::kHealthChannel, handlers.health);
  Register(by_channel, protocol::kEmulatorTruthChannel, handlers.truth);

  SessionLogSummary summary;
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    if (summary.messages++ == 0) summary.first_us = event->timestamp;
    summary.last_us = event->timestamp;
    const auto handler = by_channel.find(event->channel);
    if (handler != by_channel.end() && !handler->second(*event)) ++summary.undecodable;
  }
  if (summary.messages == 0) {
    throw UserError(path + ": holds no LCM message; give the file that lcm-logger wrote");
  }
  return summary;
}

}  // namespace torquer
