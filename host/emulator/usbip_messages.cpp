#include "host/emulator/usbip_messages.h"

#include <algorithm>

namespace torquer::emulator::usbip {
namespace {

constexpr std::uint32_t kToHost = 1;
constexpr std::uint32_t kFullSpeed = 2;
constexpr std::uint32_t kBusNumber = 1, kDeviceNumber = 2;

void AppendU16(Bytes& out, std::uint16_t value) {
  out.push_back(static_cast<std::uint8_t>(value >> 8));
  out.push_back(static_cast<std::uint8_t>(value));
}

// A field of text of a fixed size, padded with zeros.
void AppendText(Bytes& out, const std::string& text, std::size_t size) {
  const std::size_t used = std::min(text.size(), size - 1);
  out.insert(out.end(), text.begin(), text.begin() + static_cast<std::ptrdiff_t>(used));
  out.insert(out.end(), size - used, 0);
}

}  // namespace

void AppendU32(Bytes& out, std::uint32_t value) {
  AppendU16(out, static_cast<std::uint16_t>(value >> 16));
  AppendU16(out, static_cast<std::uint16_t>(value));
}

std::uint32_t U32At(std::span<const std::uint8_t> bytes, std::size_t offset) {
  return static_cast<std::uint32_t>(bytes[offset]) << 24 |
         static_cast<std::uint32_t>(bytes[offset + 1]) << 16 |
         static_cast<std::uint32_t>(bytes[offset + 2]) << 8 | bytes[offset + 3];
}

Transfer ParseTransfer(std::span<const std::uint8_t> bytes) {
  Transfer transfer;
  transfer.command = U32At(bytes, 0);
  transfer.sequence = U32At(bytes, 4);
  transfer.to_host = U32At(bytes, 12) == kToHost;
  transfer.endpoint = U32At(bytes, 16);
  if (transfer.command == kUnlink) {
    transfer.victim = U32At(bytes, 20);
  } else {
    transfer.length = U32At(bytes, 24);
    std::copy_n(bytes.begin() + 40, transfer.setup.size(), transfer.setup.begin());
  }
  return transfer;
}

void AppendReturnSubmit(Bytes& out, std::uint32_t sequence, std::int32_t status,
                        std::uint32_t actual, std::span<const std::uint8_t> data) {
  AppendU32(out, kReturnSubmit);
  AppendU32(out, sequence);
  out.insert(out.end(), 12, 0);  // device, direction, endpoint: the kernel goes by the sequence
  AppendU32(out, static_cast<std::uint32_t>(status));
  AppendU32(out, actual);
  out.insert(out.end(), 20, 0);  // frames and errors of isochronous transfers
  out.insert(out.end(), data.begin(), data.end());
}

void AppendReturnUnlink(Bytes& out, std::uint32_t sequence, std::int32_t status) {
  AppendU32(out, kReturnUnlink);
  AppendU32(out, sequence);
  out.insert(out.end(), 12, 0);
  AppendU32(out, static_cast<std::uint32_t>(status));
  out.insert(out.end(), 24, 0);
}

void AppendOperation(Bytes& out, std::uint16_t code, std::uint32_t status) {
  AppendU16(out, kVersion);
  AppendU16(out, code);
  AppendU32(out, status);
}

void AppendDevice(Bytes& out, const std::string& bus_id, std::span<const std::uint8_t> device,
                  std::span<const std::uint8_t> configuration) {
  AppendText(out, "/sys/devices/torquer/" + bus_id, 256);
  AppendText(out, bus_id, kBusIdBytes);
  AppendU32(out, kBusNumber);
  AppendU32(out, kDeviceNumber);
  AppendU32(out, kFullSpeed);
  for (const std::size_t field : {8, 10, 12}) {  // vendor, product, release: little-endian there
    out.push_back(device[field + 1]);
    out.push_back(device[field]);
  }
  out.insert(out.end(), device.begin() + 4, device.begin() + 7);  // class, subclass, protocol
  out.push_back(configuration[5]);                                // bConfigurationValue
  out.push_back(device[17]);                                      // bNumConfigurations
  out.push_back(configuration[4]);                                // bNumInterfaces
}

}  // namespace torquer::emulator::usbip
