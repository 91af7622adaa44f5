#include "host/daemon/claim.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <type_traits>

#include "host/support/error.h"
#include "host/support/fnv1a.h"

namespace torquer::daemon {

std::string DeviceClaimName(const std::string& device) {
  return bus::ClaimName("device", std::filesystem::path(device).filename().string(), device);
}

std::string InstrumentClaimName(const std::string& instrument, const std::string& lcm_url) {
  return bus::BusClaimName("instrument", instrument, lcm_url);
}

// Two slots, written in turn, each with a checksum: one of them is always complete.
struct InstrumentClaim::Record {
  struct Slot {
    std::uint64_t count;
    LastCommand command;
    std::uint64_t checksum;
  };
  Slot slots[2];

  static std::uint64_t Checksum(const Slot& slot) {
    return Fnv1a({reinterpret_cast<const char*>(&slot), offsetof(Slot, checksum)});
  }
};

InstrumentClaim::InstrumentClaim(const std::string& instrument, const std::string& lcm_url)
    : claim_(InstrumentClaimName(instrument, lcm_url),
             {.what = fmt::format("the instrument '{}'", instrument)}) {
  static_assert(std::is_trivially_copyable_v<Record>);
  bus::RemoveStaleClaims();
  constexpr std::size_t kSize = bus::Claim::kRecordOffset + sizeof(Record);
  void* memory = MAP_FAILED;
  // posix_fallocate detects a full file system here, instead of by a SIGBUS at the first store.
  int reason = 0;
  do {
    reason = posix_fallocate(claim_.file(), 0, kSize);
  } while (reason == EINTR);
  if (reason == 0) {
    memory = mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_SHARED, claim_.file(), 0);
    reason = errno;
  }
  if (memory == MAP_FAILED) {
    throw UserError(fmt::format(
        "{}: the last position of '{}' cannot be kept: {}; free space in XDG_RUNTIME_DIR",
        bus::ClaimPath(InstrumentClaimName(instrument, lcm_url)), instrument,
        std::strerror(reason)));
  }
  record_ = reinterpret_cast<Record*>(static_cast<char*>(memory) + bus::Claim::kRecordOffset);
  for (const Record::Slot& slot : record_->slots) {
    if (slot.count == 0 || slot.checksum != Record::Checksum(slot)) continue;
    if (slot.count <= count_) continue;
    count_ = slot.count;
    previous_ = slot.command;
  }
}

InstrumentClaim::~InstrumentClaim() {
  munmap(reinterpret_cast<char*>(record_) - bus::Claim::kRecordOffset,
         bus::Claim::kRecordOffset + sizeof(Record));
}

void InstrumentClaim::Remember(const LastCommand& command) {
  ++count_;
  Record::Slot slot{};
  slot.count = count_;
  slot.command = command;
  slot.checksum = Record::Checksum(slot);
  std::memcpy(&record_->slots[count_ % 2], &slot, sizeof slot);
}

}  // namespace torquer::daemon
