// Messages of USB/IP, protocol 1.1.1, between a host with a device and a remote Linux kernel that
// uses it. Reference: Documentation/usb/usbip_protocol.rst in the kernel's sources. All numbers are
// big-endian. Before an import the messages are operations; after it, transfers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace torquer::emulator::usbip {

inline constexpr std::uint16_t kVersion = 0x0111;
inline constexpr std::uint16_t kRequestDevices = 0x8005, kReplyDevices = 0x0005;
inline constexpr std::uint16_t kRequestImport = 0x8003, kReplyImport = 0x0003;
inline constexpr std::uint32_t kSubmit = 1, kUnlink = 2, kReturnSubmit = 3, kReturnUnlink = 4;
inline constexpr std::size_t kOperationBytes = 8;  ///< version, code, status
inline constexpr std::size_t kBusIdBytes = 32;     ///< follows kRequestImport
inline constexpr std::size_t kTransferBytes = 48;  ///< every transfer message but for its data
inline constexpr std::size_t kDeviceBytes = 312;   ///< a device's record
/// Longest data that a transfer may announce, far above any transfer of the device.
inline constexpr std::uint32_t kLongestData = 65536;

/// kSubmit or kUnlink, as the kernel sends them.
struct Transfer {
  std::uint32_t command = 0;
  std::uint32_t sequence = 0;
  bool to_host = false;
  std::uint32_t endpoint = 0;
  std::uint32_t length = 0;           ///< kSubmit: of the data, either way
  std::array<std::uint8_t, 8> setup;  ///< kSubmit on endpoint 0
  std::uint32_t victim = 0;           ///< kUnlink: sequence of the transfer that is to end
};

using Bytes = std::vector<std::uint8_t>;

/// From kTransferBytes bytes.
Transfer ParseTransfer(std::span<const std::uint8_t> bytes);

/// The end of a transfer: `status` 0 or a negative errno, `actual` bytes passed, `data` for the
/// host.
void AppendReturnSubmit(Bytes& out, std::uint32_t sequence, std::int32_t status,
                        std::uint32_t actual, std::span<const std::uint8_t> data);
void AppendReturnUnlink(Bytes& out, std::uint32_t sequence, std::int32_t status);

/// Head of an operation's reply; `status` 0 or 1.
void AppendOperation(Bytes& out, std::uint16_t code, std::uint32_t status);
/// A device's record, made of its descriptors (18 bytes, and 9 or more).
void AppendDevice(Bytes& out, const std::string& bus_id, std::span<const std::uint8_t> device,
                  std::span<const std::uint8_t> configuration);

void AppendU32(Bytes& out, std::uint32_t value);
std::uint32_t U32At(std::span<const std::uint8_t> bytes, std::size_t offset);

}  // namespace torquer::emulator::usbip
