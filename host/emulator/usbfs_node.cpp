#include "host/emulator/usbfs_node.h"

#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <utility>

namespace torquer::emulator {
namespace {

// A usbfs file is always writable under umockdev, so libusb asks again at once. A short wait avoids
// a busy loop.
constexpr auto kReapWait = std::chrono::milliseconds(2);
// Period of the check if the program has closed the file.
constexpr auto kClosedWait = std::chrono::milliseconds(20);
// Time of failed requests for ended transfers after which a program is assumed to want none.
constexpr auto kIdle = std::chrono::milliseconds(500);
constexpr std::size_t kSetupBytes = 8;

usbdevfs_urb& Of(UMockdevIoctlData* urb) { return *reinterpret_cast<usbdevfs_urb*>(urb->data); }

}  // namespace

UsbfsNode::~UsbfsNode() {
  Forget([](Client*) { return true; });
}

void UsbfsNode::WaitForProgram(std::chrono::milliseconds longest) {
  std::unique_lock lock(mutex_);
  while (waiting_ && !owes_nothing_ && std::chrono::steady_clock::now() < last_call_ + longest) {
    ForgetClosed();
    if (claimants_.empty() || !inputs_.empty() || !controls_.empty() || !under_way_.empty() ||
        !clearing_.empty() || !cleared_.empty() || gone_) {
      return;
    }
    changed_.wait_for(lock, kClosedWait);
  }
}

void UsbfsNode::StopWaiting() {
  const std::lock_guard lock(mutex_);
  waiting_ = false;
  changed_.notify_all();
}

bool UsbfsNode::WantsInput() const {
  const std::lock_guard lock(mutex_);
  return !inputs_.empty();
}

bool UsbfsNode::EndInput(int status, std::span<const std::uint8_t> bytes) {
  const std::lock_guard lock(mutex_);
  if (inputs_.empty()) return false;
  const Urb urb = inputs_.front();
  inputs_.pop_front();
  const std::size_t size =
      urb.buffer ? std::min(bytes.size(), static_cast<std::size_t>(urb.buffer->data_len)) : 0;
  if (size > 0) std::memcpy(urb.buffer->data, bytes.data(), size);
  End(urb, status, size);
  return true;
}

std::optional<UsbfsNode::Control> UsbfsNode::TakeControl() {
  const std::lock_guard lock(mutex_);
  if (controls_.empty()) return std::nullopt;
  const Urb urb = controls_.front();
  controls_.pop_front();
  under_way_.push_back(urb);
  const std::uint8_t* bytes = urb.buffer->data;
  const auto word = [bytes](int at) {
    return static_cast<std::uint16_t>(bytes[at] | (bytes[at + 1] << 8));
  };
  Control control{urb.id, {bytes[0], bytes[1], word(2), word(4), word(6)}, {}};
  if (!(control.setup.type & 0x80)) {
    control.data.assign(bytes + kSetupBytes, bytes + urb.buffer->data_len);
  }
  return control;
}

void UsbfsNode::EndControl(std::uint64_t id, int status, std::span<const std::uint8_t> bytes,
                           std::size_t length) {
  const std::lock_guard lock(mutex_);
  const auto urb = std::find_if(under_way_.begin(), under_way_.end(),
                                [id](const Urb& other) { return other.id == id; });
  if (urb == under_way_.end()) return;
  const std::size_t room = static_cast<std::size_t>(urb->buffer->data_len) - kSetupBytes;
  std::copy_n(bytes.begin(), std::min(bytes.size(), room), urb->buffer->data + kSetupBytes);
  const Urb ended = *urb;
  under_way_.erase(urb);
  End(ended, status, std::min(length, room));
}

bool UsbfsNode::TakeClearHalt() {
  const std::lock_guard lock(mutex_);
  if (clearing_.empty()) return false;
  cleared_.splice(cleared_.end(), clearing_, clearing_.begin());
  return true;
}

void UsbfsNode::EndClearHalt() {
  const std::lock_guard lock(mutex_);
  if (cleared_.empty()) return;
  Answer(cleared_.front(), 0, 0);
  g_object_unref(cleared_.front());
  cleared_.pop_front();
}

void UsbfsNode::Vanish() {
  const std::lock_guard lock(mutex_);
  gone_ = true;
  for (std::list<Urb>* queue : {&inputs_, &controls_, &under_way_}) {
    for (const Urb& urb : *queue) End(urb, -ESHUTDOWN, 0);
    queue->clear();
  }
  for (std::list<Client*>* queue : {&clearing_, &cleared_}) {
    for (Client* client : *queue) {
      Answer(client, -1, ENODEV);
      g_object_unref(client);
    }
    queue->clear();
  }
  changed_.notify_all();
}

bool UsbfsNode::Answer(Client* client, glong result, gint error) {
  umockdev_ioctl_client_complete(client, result, error);
  return true;
}

bool UsbfsNode::Ioctl(Client* client) {
  UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
  const gulong request = umockdev_ioctl_client_get_request(client);
  if (request == USBDEVFS_REAPURB || request == USBDEVFS_REAPURBNDELAY) {
    return Reap(client, argument);
  }
  std::unique_lock lock(mutex_);
  last_call_ = std::chrono::steady_clock::now();
  ForgetClosed();
  if (gone_) return Answer(client, -1, ENODEV);
  switch (request) {
    case USBDEVFS_GET_CAPABILITIES: {
      UMockdevIoctlData* data =
          umockdev_ioctl_data_resolve(argument, 0, sizeof(std::uint32_t), nullptr);
      if (!data) return Answer(client, -1, EFAULT);
      const std::uint32_t capabilities = USBDEVFS_CAP_BULK_CONTINUATION |
                                         USBDEVFS_CAP_NO_PACKET_SIZE_LIM |
                                         USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
      std::memcpy(data->data, &capabilities, sizeof(capabilities));
      g_object_unref(data);
      return Answer(client, 0, 0);
    }
    case USBDEVFS_CLAIMINTERFACE:
      // A program that was killed in the middle of a call is not seen to have closed the file.
      Forget([client](Client* other) { return other != client; });
      claimants_.push_back(client);
      NoteTransfer();
      g_object_ref(client);
      return Answer(client, 0, 0);
    case USBDEVFS_RELEASEINTERFACE: {
      const auto claim = std::find(claimants_.begin(), claimants_.end(), client);
      if (claim == claimants_.end()) return Answer(client, -1, EINVAL);
      claimants_.erase(claim);
      g_object_unref(client);
      changed_.notify_all();
      return Answer(client, 0, 0);
    }
    case USBDEVFS_SETCONFIGURATION:
    case USBDEVFS_SETINTERFACE:
    case USBDEVFS_RESETEP:
    case USBDEVFS_RESET:
      return Answer(client, 0, 0);
    case USBDEVFS_CLEAR_HALT:
      clearing_.push_back(client);  // answered by EndClearHalt() or Vanish()
      g_object_ref(client);
      changed_.notify_all();
      return true;
    case USBDEVFS_GETDRIVER:
    case USBDEVFS_IOCTL:  // no kernel driver to detach
      return Answer(client, -1, ENODATA);
    case USBDEVFS_SUBMITURB:
      return Submit(client, argument);
    case USBDEVFS_DISCARDURB:
      return Discard(client, argument);
    default:
      return Answer(client, -1, ENOTTY);
  }
}

// Holds the mutex from the check for an unplugged device until the transfer is queued. A transfer
// that is queued after an unplug would never end.
bool UsbfsNode::Submit(Client* client, UMockdevIoctlData* argument) {
  Urb urb{};
  urb.urb = umockdev_ioctl_data_resolve(argument, 0, sizeof(usbdevfs_urb), nullptr);
  if (!urb.urb) return Answer(client, -1, EFAULT);
  const usbdevfs_urb& given = Of(urb.urb);
  const bool control = given.type == USBDEVFS_URB_TYPE_CONTROL;
  if (given.buffer_length > 0) {
    urb.buffer = umockdev_ioctl_data_resolve(urb.urb, offsetof(usbdevfs_urb, buffer),
                                             static_cast<gsize>(given.buffer_length), nullptr);
  }
  if (!urb.buffer || (control && given.buffer_length < static_cast<int>(kSetupBytes))) {
    if (urb.buffer) g_object_unref(urb.buffer);
    g_object_unref(urb.urb);
    return Answer(client, -1, EINVAL);
  }
  urb.id = ++last_id_;
  urb.client = client;
  g_object_ref(client);
  // Answers first, because with the answer umockdev looks for changes of the transfer.
  Answer(client, 0, 0);
  (control ? controls_ : inputs_).push_back(urb);
  NoteTransfer();
  changed_.notify_all();
  return true;
}

bool UsbfsNode::Reap(Client* client, UMockdevIoctlData* argument) {
  const auto own = [client](const Urb& urb) { return urb.client == client; };
  std::unique_lock lock(mutex_);
  last_call_ = std::chrono::steady_clock::now();
  NoteReap(client);
  auto urb = ended_.end();
  reapable_.wait_for(lock, kReapWait, [&] {
    urb = std::find_if(ended_.begin(), ended_.end(), own);
    return urb != ended_.end();
  });
  if (urb == ended_.end()) return Answer(client, -1, gone_ ? ENODEV : EAGAIN);
  UMockdevIoctlData* pointer = umockdev_ioctl_data_resolve(argument, 0, sizeof(gpointer), nullptr);
  if (!pointer) return Answer(client, -1, EFAULT);
  umockdev_ioctl_data_set_ptr(pointer, 0, urb->urb);
  Answer(client, 0, 0);
  g_object_unref(pointer);
  Release(*urb);
  ended_.erase(urb);
  return true;
}

void UsbfsNode::NoteTransfer() {
  idle_since_.reset();
  owes_nothing_ = false;
}

// One such question follows the last of a program's transfers as a matter of course; many do not.
void UsbfsNode::NoteReap(Client* client) {
  if (std::find(claimants_.begin(), claimants_.end(), client) == claimants_.end()) return;
  for (const std::list<Urb>* queue : {&inputs_, &controls_, &under_way_, &ended_}) {
    for (const Urb& urb : *queue) {
      if (urb.client == client) return;
    }
  }
  if (!idle_since_) idle_since_ = last_call_;
  if (last_call_ - *idle_since_ < kIdle) return;
  owes_nothing_ = true;
  changed_.notify_all();
}

bool UsbfsNode::Discard(Client* client, UMockdevIoctlData* argument) {
  gulong address = 0;
  std::memcpy(&address, argument->data, sizeof(address));
  for (std::list<Urb>* queue : {&inputs_, &controls_, &under_way_}) {
    const auto urb = std::find_if(queue->begin(), queue->end(), [&](const Urb& other) {
      return other.client == client && other.urb->client_addr == address;
    });
    if (urb == queue->end()) continue;
    End(*urb, -ENOENT, 0);
    queue->erase(urb);
    return Answer(client, 0, 0);
  }
  return Answer(client, -1, EINVAL);
}

void UsbfsNode::End(const Urb& urb, int status, std::size_t length) {
  Of(urb.urb).status = status;
  Of(urb.urb).actual_length = static_cast<int>(length);
  ended_.push_back(urb);
  reapable_.notify_all();
}

void UsbfsNode::ForgetClosed() {
  Forget([](Client* client) { return !umockdev_ioctl_client_get_connected(client); });
}

template <typename Predicate>
void UsbfsNode::Forget(Predicate of_client) {
  for (std::list<Urb>* queue : {&inputs_, &controls_, &under_way_, &ended_}) {
    queue->remove_if([&](const Urb& urb) {
      if (!of_client(urb.client)) return false;
      Release(urb);
      return true;
    });
  }
  for (std::list<Client*>* queue : {&claimants_, &clearing_, &cleared_}) {
    queue->remove_if([&](Client* client) {
      if (!of_client(client)) return false;
      g_object_unref(client);
      return true;
    });
  }
}

void UsbfsNode::Release(const Urb& urb) {
  g_object_unref(urb.buffer);
  g_object_unref(urb.urb);
  g_object_unref(urb.client);
}

}  // namespace torquer::emulator
