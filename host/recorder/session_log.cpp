#include "host/recorder/session_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <iterator>
#include <map>
#include <string_view>

#include "host/bus/message_check.h"
#include "host/support/error.h"
#include "protocol/lcm_channels.h"

namespace torquer {
namespace {

using RawHandler = std::function<bool(const LogRecord&)>;

template <class Message>
void Register(std::map<std::string, RawHandler, std::less<>>& handlers, const char* channel,
              const std::function<void(const Message&)>& handle) {
  if (!handle) return;
  handlers[channel] = [&handle](const LogRecord& record) {
    Message message;
    if (!bus::DecodeMessage(record.data.data(), record.data.size(), message)) return false;
    handle(message);
    return true;
  };
}

// Counts a message on an unknown channel that begins with TORQUER.
void CountUnknown(std::string_view channel, SessionLogSummary& summary) {
  constexpr std::size_t kMostChannels = 20;
  const auto& ours = protocol::kChannels;
  if (!channel.starts_with("TORQUER")) return;
  if (std::find(std::begin(ours), std::end(ours), channel) != std::end(ours)) return;
  const std::string name(channel);
  const bool room = summary.unknown.size() < kMostChannels || summary.unknown.contains(name);
  if (room) ++summary.unknown[name];
}

}  // namespace

SessionLogSummary ReadSessionLog(const std::string& path, const SessionHandlers& handlers) {
  EventLogReader log(path);
  std::map<std::string, RawHandler, std::less<>> by_channel;
  Register(by_channel, protocol::kDeviceSampleChannel, handlers.sample);
  Register(by_channel, protocol::kInstrumentCommandChannel, handlers.command);
  Register(by_channel, protocol::kImagingCommandChannel, handlers.imaging);
  Register(by_channel, protocol::kWedgeCommandChannel, handlers.wedges);
  Register(by_channel, protocol::kTableCommandChannel, handlers.table);
  Register(by_channel, protocol::kInjectorCommandChannel, handlers.injector);
  Register(by_channel, protocol::kWireStateChannel, handlers.state);
  Register(by_channel, protocol::kSceneChannel, handlers.scene);
  Register(by_channel, protocol::kDevicesChannel, handlers.devices);
  Register(by_channel, protocol::kReadingsChannel, handlers.readings);
  Register(by_channel, protocol::kHealthChannel, handlers.health);
  Register(by_channel, protocol::kEmulatorTruthChannel, handlers.truth);

  SessionLogSummary summary;
  for (LogRecord record; log.Next(record);) {
    if (summary.messages == 0) summary.started_us = record.time_us;
    if (log.logs() > 1) continue;
    ++summary.messages;
    const auto handler = by_channel.find(record.channel);
    if (handler == by_channel.end()) CountUnknown(record.channel, summary);
    if (handler != by_channel.end() && !handler->second(record)) ++summary.undecodable;
  }
  log.RequireOneLog();
  summary.damage = log.damage();
  if (summary.messages == 0) {
    throw UserError(path + ": holds no LCM message; give the file that torquer-recorder wrote");
  }
  return summary;
}

}  // namespace torquer
