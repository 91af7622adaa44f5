// A usbfs file on a machine mocked by umockdev. Submitted transfers of programs wait for the
// device.
#pragma once

#include <umockdev.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <list>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "host/emulator/usb_host.h"

namespace torquer::emulator {

/// One device's file from plug to unplug, and the transfers on their way. Programs' calls come in
/// umockdev's thread, the device's in another.
///
/// A transfer ends once and belongs to the program that submitted it. It is discarded when the
/// program closes the file, or when another program claims the interface.
class UsbfsNode {
 public:
  /// A control transfer on its way through the device.
  struct Control {
    std::uint64_t id;
    SetupPacket setup;
    std::vector<std::uint8_t> data;  ///< to the device
  };

  UsbfsNode() = default;
  ~UsbfsNode();
  UsbfsNode(const UsbfsNode&) = delete;
  UsbfsNode& operator=(const UsbfsNode&) = delete;

  /// Waits while a program that has claimed the interface owes a transfer, at most `longest` after
  /// its last call. The wait ends when the program asks for ended transfers but has none pending:
  /// then it waits for another event. So a program that was killed is waited for only once.
  void WaitForProgram(std::chrono::milliseconds longest);
  /// Ends that wait, and prevents later ones.
  void StopWaiting();

  /// True if an input transfer waits.
  bool WantsInput() const;
  /// Ends the oldest input transfer with `status` (0 or a negative errno) and as many `bytes` as
  /// fit. Returns false if none waits.
  bool EndInput(int status, std::span<const std::uint8_t> bytes);

  /// Takes the oldest control transfer that waits; EndControl() gives it back.
  std::optional<Control> TakeControl();
  /// Ends it with `status`. `bytes`: data from the device; `length`: number of bytes that it took
  /// or sent. Has no effect if the program has abandoned the transfer.
  void EndControl(std::uint64_t id, int status, std::span<const std::uint8_t> bytes,
                  std::size_t length);

  /// True if a program waits for the halt of the input endpoint to be cleared; asked once for each.
  bool TakeClearHalt();
  /// Ends the program's wait.
  void EndClearHalt();

  /// A program's call, from umockdev: see AttachIoctls().
  bool Ioctl(UMockdevIoctlClient* client);

  /// The device is gone: every transfer ends as when a cable is pulled, every call fails.
  void Vanish();

 private:
  using Client = UMockdevIoctlClient;

  // A transfer in the program's memory; umockdev copies changes back.
  struct Urb {
    std::uint64_t id;
    Client* client;
    UMockdevIoctlData* urb;
    UMockdevIoctlData* buffer;
  };

  bool Submit(Client* client, UMockdevIoctlData* argument);
  bool Reap(Client* client, UMockdevIoctlData* argument);
  bool Discard(Client* client, UMockdevIoctlData* argument);
  bool ClearHalt(Client* client);
  static bool Answer(Client* client, glong result, gint error);

  // The mutex is held in all of these.
  void End(const Urb& urb, int status, std::size_t length);
  void ForgetClosed();
  void NoteTransfer();
  void NoteReap(Client* client);
  template <typename Predicate>
  void Forget(Predicate of_client);
  static void Release(const Urb& urb);

  mutable std::mutex mutex_;
  std::condition_variable changed_;   // for the device's thread
  std::condition_variable reapable_;  // for umockdev's
  std::uint64_t last_id_ = 0;
  std::list<Urb> inputs_, controls_, under_way_, ended_;
  std::list<Client*> claimants_;           // one entry for each claim
  std::list<Client*> clearing_, cleared_;  // that wait for a halt to be cleared: to take, taken
  std::chrono::steady_clock::time_point last_call_ = std::chrono::steady_clock::now();
  // Since when the program has asked for ended transfers without having any, and whether it goes
  // on.
  std::optional<std::chrono::steady_clock::time_point> idle_since_;
  bool owes_nothing_ = false;
  bool gone_ = false;
  bool waiting_ = true;
};

}  // namespace torquer::emulator
