#include "firmware/src/pmw3360_bus.h"

#include "firmware/board/board.h"

namespace torquer {
namespace firmware {

using pmw3360::kAddressToBurst;
using pmw3360::kAddressToData;
using pmw3360::kAfterBurst;
using pmw3360::kAfterRead;
using pmw3360::kAfterWrite;
using pmw3360::kBurstBytes;
using pmw3360::kLongBurstByte;
using pmw3360::kMotionBurst;
using pmw3360::kWriteBit;
using pmw3360::kWriteToDeselect;

void Pmw3360Bus::WaitUntilReady() {
  const int32_t remaining = static_cast<int32_t>(ready_at_us_ - board::NowUs());
  if (remaining > 0) board::DelayUs(static_cast<uint16_t>(remaining));
}

uint8_t Pmw3360Bus::Read(uint8_t address) {
  WaitUntilReady();
  Select(true);
  board::TransferSpi(address);
  board::DelayUs(kAddressToData);
  const uint8_t value = board::TransferSpi(0);
  Select(false);
  ready_at_us_ = board::NowUs() + kAfterRead;
  return value;
}

void Pmw3360Bus::Write(uint8_t address, uint8_t value) {
  WaitUntilReady();
  Select(true);
  board::TransferSpi(address | kWriteBit);
  board::TransferSpi(value);
  board::DelayUs(kWriteToDeselect);
  Select(false);
  ready_at_us_ = board::NowUs() + kAfterWrite;
}

void Pmw3360Bus::BeginMotion() {
  WaitUntilReady();
  Select(true);
  board::TransferSpi(kMotionBurst);
  ready_at_us_ = board::NowUs() + kAddressToBurst;
}

void Pmw3360Bus::FinishMotion(uint8_t burst[kBurstBytes]) {
  WaitUntilReady();
  board::ReadSpi(burst, kBurstBytes);
  Select(false);
  ready_at_us_ = board::NowUs() + kAfterBurst;
}

void Pmw3360Bus::BeginLongBurst(uint8_t address) {
  WaitUntilReady();
  Select(true);
  board::TransferSpiAfter(address, kLongBurstByte);
  if (!(address & kWriteBit)) board::DelayUs(kAddressToData);
}

void Pmw3360Bus::EndLongBurst(uint16_t pause_us) {
  board::DelayUs(kLongBurstByte);
  Select(false);
  ready_at_us_ = board::NowUs() + pause_us;
}

}  // namespace firmware
}  // namespace torquer
