// A mocked device's calls, answered by an object of ours.
#pragma once

#include <umockdev.h>

#include <memory>
#include <set>
#include <stdexcept>
#include <string>

namespace torquer::emulator {

/// Connects the ioctls on the file `path` to `device->Ioctl(client)`, which returns true if it has
/// accepted the call. The thread of umockdev makes the call. It shares the device's ownership,
/// because it runs for a moment after the end of the testbed. Throws std::runtime_error if umockdev
/// refuses.
template <class Device>
void AttachIoctls(UMockdevTestbed* testbed, const std::string& path,
                  const std::shared_ptr<Device>& device) {
  using SharedDevice = std::shared_ptr<Device>;
  const auto on_ioctl = +[](UMockdevIoctlBase* /*handler*/, UMockdevIoctlClient* client,
                            gpointer shared) -> gboolean {
    return (*static_cast<SharedDevice*>(shared))->Ioctl(client) ? TRUE : FALSE;
  };
  const auto release =
      +[](gpointer shared, GClosure* /*closure*/) { delete static_cast<SharedDevice*>(shared); };
  UMockdevIoctlBase* handler = umockdev_ioctl_base_new();
  g_signal_connect_data(handler, "handle-ioctl", G_CALLBACK(on_ioctl), new SharedDevice(device),
                        release, GConnectFlags{});
  GError* error = nullptr;
  umockdev_testbed_attach_ioctl(testbed, path.c_str(), handler, &error);
  g_object_unref(handler);
  if (error == nullptr) return;
  const std::string message = error->message;
  g_error_free(error);
  throw std::runtime_error("umockdev: " + message);
}

/// The files of one testbed whose ioctls are answered. After an unplug, the device still answers
/// ("no such device"). If an ioctl found a closed connection, umockdev would abort the program.
class AnsweredFiles {
 public:
  explicit AnsweredFiles(UMockdevTestbed* testbed) : testbed_(testbed) {}
  AnsweredFiles(const AnsweredFiles&) = delete;
  AnsweredFiles& operator=(const AnsweredFiles&) = delete;
  ~AnsweredFiles() {
    for (const std::string& path : paths_) Detach(path);
  }

  /// Same as AttachIoctls; replaces the device that had this file before.
  template <class Device>
  void Attach(const std::string& path, const std::shared_ptr<Device>& device) {
    if (!paths_.insert(path).second) Detach(path);
    AttachIoctls(testbed_, path, device);
  }

 private:
  void Detach(const std::string& path) {
    umockdev_testbed_detach_ioctl(testbed_, path.c_str(), nullptr);
  }

  UMockdevTestbed* testbed_;
  std::set<std::string> paths_;
};

}  // namespace torquer::emulator
