// The device's reports over a Unix socket, for machines without USB.
//
// A SOCK_SEQPACKET connection; each packet is one kind byte and its payload. Reports are carried
// byte for byte as on the USB, report id first. The device side (the emulator) listens.
#pragma once

#include <stdint.h>

#include "protocol/hid_reports.h"

namespace torquer {
namespace protocol {

enum class SocketPacket : uint8_t {
  kInput = 'I',       ///< device to host: an InputReport
  kGetFeature = 'G',  ///< host to device: one byte, the report id
  kSetFeature = 'S',  ///< host to device: a feature report
  kFeature = 'F',     ///< device to host: the requested feature report
  kDone = 'D',        ///< device to host: the feature report was taken
  kStall = 'X',       ///< device to host: the request was refused, as by a USB STALL
};

/// Longest packet: kind byte and the largest report, with room to detect an overlong one.
constexpr int kSocketPacketMax = 2 + kLongestReportBytes;

}  // namespace protocol
}  // namespace torquer
