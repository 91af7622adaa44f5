// User program on unmodified libusb, through which tests access devices.
#pragma once

#include <libusb.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "protocol/hid_reports.h"
#include "protocol/usb_ids.h"

namespace torquer::hil {

constexpr unsigned char kInput = 0x80 | protocol::kInputEndpoint;
constexpr unsigned kTimeoutMs = 5000;

/// libusb with the device opened and its interface claimed.
class Program {
 public:
  Program() { REQUIRE(libusb_init(&context_) == 0); }
  ~Program() {
    Close();
    libusb_exit(context_);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  /// Opens the device, which must exist and must not be in use.
  void Open() {
    handle_ =
        libusb_open_device_with_vid_pid(context_, protocol::kUsbVendorId, protocol::kUsbProductId);
    REQUIRE(handle_);
    libusb_set_auto_detach_kernel_driver(handle_, 1);
    REQUIRE(libusb_claim_interface(handle_, 0) == 0);
  }
  /// Waits for the device, for example after a restart, and opens it.
  void OpenAgain() {
    Close();
    for (int i = 0; i < 600 && handle_ == nullptr; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      handle_ = libusb_open_device_with_vid_pid(context_, protocol::kUsbVendorId,
                                                protocol::kUsbProductId);
    }
    REQUIRE(handle_);
    libusb_set_auto_detach_kernel_driver(handle_, 1);
    REQUIRE(libusb_claim_interface(handle_, 0) == 0);
  }
  void Close() {
    if (handle_) libusb_close(handle_);
    handle_ = nullptr;
  }

  int ReadInput(std::vector<unsigned char>* packet) {
    packet->assign(sizeof(protocol::InputReport), 0);
    int size = 0;
    const int result = libusb_interrupt_transfer(
        handle_, kInput, packet->data(), static_cast<int>(packet->size()), &size, kTimeoutMs);
    packet->resize(static_cast<std::size_t>(size));
    return result;
  }
  protocol::InputReport ReadReport() {
    std::vector<unsigned char> packet;
    REQUIRE(ReadInput(&packet) == 0);
    REQUIRE(packet.size() == sizeof(protocol::InputReport));
    protocol::InputReport report;
    std::memcpy(&report, packet.data(), sizeof(report));
    return report;
  }

  int GetFeature(int id, std::vector<unsigned char>* report, unsigned timeout_ms = kTimeoutMs) {
    report->assign(64, 0);
    const int size =
        libusb_control_transfer(handle_, 0xa1, 1, static_cast<std::uint16_t>(0x300 | id), 0,
                                report->data(), 64, timeout_ms);
    if (size >= 0) report->resize(static_cast<std::size_t>(size));
    return size;
  }
  int SetFeature(std::vector<unsigned char> report) {
    return libusb_control_transfer(handle_, 0x21, 9, static_cast<std::uint16_t>(0x300 | report[0]),
                                   0, report.data(), static_cast<std::uint16_t>(report.size()),
                                   kTimeoutMs);
  }
  /// Reads a feature report as its struct.
  template <typename Report>
  Report Get(int id) {
    std::vector<unsigned char> bytes;
    REQUIRE(GetFeature(id, &bytes) == sizeof(Report));
    Report report;
    std::memcpy(&report, bytes.data(), sizeof(report));
    return report;
  }
  template <typename Report>
  int Set(const Report& report) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(&report);
    return SetFeature({bytes, bytes + sizeof(report)});
  }

  libusb_context* context() { return context_; }
  libusb_device_handle* handle() { return handle_; }

 private:
  libusb_context* context_ = nullptr;
  libusb_device_handle* handle_ = nullptr;
};

}  // namespace torquer::hil
