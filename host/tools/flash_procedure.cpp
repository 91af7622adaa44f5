#include "host/tools/flash_procedure.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "host/device/sensor_firmware.h"
#include "host/tools/board_reports.h"

namespace torquer::tools {
namespace {

using protocol::BootloaderStatusReport;
using protocol::ConfigurationReport;
using protocol::IdentityReport;
using protocol::PageReport;

// Timeout for a change between firmware and bootloader: reset, and enumeration by the host.
constexpr int kChangeMs = 30000;
// Timeout for the sensor, which needs some 100 ms after the start.
constexpr int kSensorMs = 2000;
// Time in which the firmware measures its supply.
constexpr int kSupplyMs = 300;

constexpr char kAgain[] = "Run the same command again: it finishes the update.";
// State of a lost board, depending on the time of the loss.
constexpr char kUntouched[] = "Nothing was changed. ";
constexpr char kOldOrNone[] =
    "The board still has its old firmware, or none and waits in its bootloader. ";
constexpr char kNoApplication[] =
    "The board has no valid application now and waits in its bootloader whenever it has power. ";
constexpr char kNewOrNone[] =
    "The board has the new firmware, or none and waits in its bootloader. ";
constexpr char kNew[] = "The new firmware is complete and starts when the board gets power. ";

void Command(FeatureLink& link, protocol::BootloaderCommand command, std::uint16_t address = 0) {
  Set(link, protocol::BootloaderCommandReport{
                protocol::kBootloaderCommandReportId, command, protocol::kCommandKey, address, {}});
}

std::string BootloaderRefuses(int its_mhz, int image_mhz) {
  return fmt::format(
      "the image is for a CPU of {} MHz, but the board's bootloader is for {} MHz and would not "
      "start it. Nothing was changed. Use another image, or install the other bootloader by ISP "
      "(firmware/bootloader/README.md).",
      image_mhz, its_mhz);
}

std::string BoardRefused(int its_board, int image_board) {
  return fmt::format(
      "the image is for {}, but this is {}, whose pins differ. Nothing was changed. Use another "
      "image. If the wiring was changed: install the other bootloader by ISP "
      "(firmware/bootloader/README.md), or reset the board into Arduino's bootloader, and name the "
      "image.",
      BoardText(image_board), BoardText(its_board));
}

void WritePage(FeatureLink& link, const FlashImage& image, int index) {
  PageReport report{protocol::kPageReportId, 0, image.PageAddress(index), {}};
  const std::vector<std::uint8_t> page = image.Page(index);
  std::copy(page.begin(), page.end(), report.data);
  Set(link, report);
}

}  // namespace

FlashProcedure::FlashProcedure(Boards& boards, FlashRequest request, FlashHooks hooks)
    : boards_(boards),
      request_(std::move(request)),
      hooks_(std::move(hooks)),
      search_(boards, request_.device, request_.port) {}

std::optional<FlashOutcome> FlashProcedure::Run() {
  const FoundBoard found = search_.Find();
  hooks_.say("found: " + found.state);
  const FlashImage image = LoadImage(found);
  CheckFits(found, image);
  if (request_.dry_run) {
    hooks_.say(fmt::format(
        "would write firmware {} ({} bytes, {} pages), verify it and start it; nothing was done",
        image.version().Text(), image.trailer().length, image.pages() + 1));
    return std::nullopt;
  }
  StopIfWanted("Nothing was changed.");
  const Board board = EnterBootloader(found);
  if (board.mode == BoardMode::kCaterina) {
    hooks_.say(
        fmt::format("writing by the board's Caterina bootloader at {}; after an interruption "
                    "its reset button may be needed",
                    board.port));
    hooks_.flash_caterina(board.port, image);
  } else {
    WriteByBootloader(board, image);
  }
  return ReadSelfTest(found, image);
}

// The board, which must run our firmware for `task`.
FoundBoard FlashProcedure::FindFirmware(const std::string& task) {
  FoundBoard found = search_.Find();
  hooks_.say("found: " + found.state);
  if (found.board.mode != BoardMode::kFirmware) {
    throw UserError("the firmware " + task +
                    ", and does not run on this board; run torquer-flash without options first");
  }
  return found;
}

void FlashProcedure::SetClosedAtRest(std::uint8_t buttons) {
  const FoundBoard found = FindFirmware("inverts the contacts");
  if (request_.dry_run) {
    hooks_.say("would set the contacts that are closed at rest; nothing was done");
    return;
  }
  try {
    const auto link = boards_.Open(found.board);
    auto configuration = Get<ConfigurationReport>(*link, protocol::kConfigurationReportId);
    configuration.closed_at_rest = buttons;
    Set(*link, configuration);
    const auto kept = Get<ConfigurationReport>(*link, protocol::kConfigurationReportId);
    if (kept.closed_at_rest == buttons) return;
  } catch (const ReportRefused& refused) {
    throw UserError(fmt::format("{}: the firmware refuses the setting ({}); run torquer-flash",
                                found.serial, refused.what()));
  } catch (const BoardLost& lost) {
    throw UserError(
        fmt::format("{}: the board was lost ({}); check the cable and run the same command again",
                    Where(found.board), lost.what()));
  }
  throw UserError(found.serial +
                  ": this firmware is too old to know contacts that are closed at rest. Nothing "
                  "was changed; run torquer-flash without options first.");
}

int FlashProcedure::LoadSensorImage(const std::string& path) {
  const std::vector<std::uint8_t> image = device::ReadSromFile(path);
  const FoundBoard found = FindFirmware("loads the image into the sensor");
  if (request_.dry_run) {
    hooks_.say(fmt::format("would load {} into its sensor; nothing was done", path));
    return 0;
  }
  try {
    // The sensor of a board that was just plugged in may still be starting.
    for (int waited = 0; waited < kSensorMs; waited += kLookMs) {
      {
        const auto link = boards_.Open(found.board);
        const auto identity = Get<IdentityReport>(*link, protocol::kIdentityReportId);
        if (identity.self_test & kSensorGood) {
          const int id = device::LoadSrom(*link, image);
          if (const auto kept = device::KeepSrom(found.serial, image)) {
            hooks_.say(
                fmt::format("saved as {}; torquer-daemon loads this copy after each loss; delete "
                            "the file to stop that",
                            *kept));
          }
          return id;
        }
      }
      boards_.Sleep(kLookMs);
    }
    throw UserError(found.serial + ": its sensor does not answer; check its wiring");
  } catch (const ReportRefused& refused) {
    throw UserError(
        fmt::format("{}: the firmware does not report its state ({}); run torquer-flash",
                    found.serial, refused.what()));
  } catch (const BoardLost& lost) {
    throw UserError(
        fmt::format("{}: the board was lost ({}). Its sensor runs without the image; "
                    "check the cable and run the same command again",
                    Where(found.board), lost.what()));
  }
}

FlashImage FlashProcedure::LoadImage(const FoundBoard& found) const {
  if (!request_.image.empty()) return FlashImage::FromFile(request_.image);
  if (found.crystal_mhz == 0) {
    throw UserError(
        "it is not known whether this board has a crystal of 8 or 16 MHz. Name the image: "
        "torquer-firmware.hex for 16 MHz at 5 V, torquer-firmware-16to8mhz.hex for 16 MHz at 3.3 "
        "V, "
        "torquer-firmware-8mhz.hex for 8 MHz.");
  }
  const bool half = found.cpu_mhz != 0 && found.cpu_mhz != found.crystal_mhz;
  const bool two = found.image_board == protocol::kBoardTwoSensorsAtmega32u4;
  const std::string name = fmt::format("torquer-firmware{}{}.hex", two ? "-two-sensors" : "",
                                       found.crystal_mhz == 8 ? "-8mhz"
                                       : half                 ? "-16to8mhz"
                                                              : "");
  return FlashImage::FromFile(std::filesystem::path(request_.image_folder) / name);
}

void FlashProcedure::CheckFits(const FoundBoard& found, const FlashImage& image) const {
  if (found.image_board != 0 && found.image_board != image.board()) {
    throw UserError(BoardRefused(found.image_board, image.board()));
  }
  if (found.crystal_mhz != 0 && found.crystal_mhz != image.crystal_mhz()) {
    throw UserError(
        fmt::format("the image is for a crystal of {} MHz, but this board has {} MHz, so USB would "
                    "not work. Use another image.",
                    image.crystal_mhz(), found.crystal_mhz));
  }
  if (found.board.mode == BoardMode::kBootloader && found.cpu_mhz != image.cpu_mhz()) {
    throw UserError(BootloaderRefuses(found.cpu_mhz, image.cpu_mhz()));
  }
  if (found.installed && image.version().IsOlderThan(*found.installed) && !request_.force) {
    throw UserError(
        fmt::format("firmware {} is installed, which is newer than the image's {}. --force "
                    "installs the older one.",
                    found.installed->Text(), image.version().Text()));
  }
}

void FlashProcedure::StopIfWanted(const std::string& state) const {
  if (hooks_.stop()) throw FlashUnfinished("stopped. " + state);
}

bool FlashProcedure::IsSame(const Board& board, const FoundBoard& before) {
  if (!board.problem.empty()) return false;
  // The kernel may not have created its serial port yet.
  if (board.mode == BoardMode::kCaterina && board.port.empty()) return false;
  if (before.serial.empty()) return before.board.place.empty() || board.place == before.board.place;
  switch (board.mode) {
    case BoardMode::kFirmware:
      return board.serial == before.serial;
    case BoardMode::kBootloader: {
      const auto link = boards_.Open(board);
      return SerialOf(Get<BootloaderStatusReport>(*link, protocol::kBootloaderStatusReportId)) ==
             before.serial;
    }
    case BoardMode::kCaterina:
      return board.place == before.board.place;
    case BoardMode::kSketch:
    case BoardMode::kDfu:
      break;
  }
  return false;
}

// Waits until the board runs its firmware if `firmware` is set, else one of its bootloaders.
std::optional<Board> FlashProcedure::WaitFor(const FoundBoard& before, int milliseconds,
                                             bool firmware) {
  for (int waited = 0; waited < milliseconds; waited += kLookMs) {
    for (const Board& board : boards_.List()) {
      const bool is_bootloader =
          board.mode == BoardMode::kBootloader || board.mode == BoardMode::kCaterina;
      if (firmware ? board.mode != BoardMode::kFirmware : !is_bootloader) continue;
      try {
        if (IsSame(board, before)) return board;
      } catch (const std::runtime_error&) {  // no error: the board is not ready yet
      }
    }
    boards_.Sleep(kLookMs);
  }
  return std::nullopt;
}

Board FlashProcedure::EnterBootloader(const FoundBoard& found) {
  if (found.board.mode == BoardMode::kSketch) return AskSketch(found);
  if (found.board.mode != BoardMode::kFirmware) return found.board;
  hooks_.say("asking the firmware to start the bootloader");
  try {
    const auto link = boards_.Open(found.board);
    Set(*link, protocol::CommandReport{protocol::kCommandReportId,
                                       protocol::kCommandEnterBootloader,
                                       protocol::kCommandKey,
                                       {}});
  } catch (const BoardLost&) {  // no error: the board has already restarted
  } catch (const ReportRefused&) {
    throw UserError(
        found.serial +
        ": the firmware refuses to enter the bootloader. Nothing was changed. Reset the "
        "board by its reset pin, which enters it too, and run the same command again.");
  }
  const std::optional<Board> board = WaitFor(found, kChangeMs, /*firmware=*/false);
  if (!board) {
    throw FlashUnfinished(
        found.serial +
        ": the board did not come back in a bootloader. Nothing was written. Unplug it, plug it in "
        "and run the same command again. A board that only restarts its firmware has no "
        "bootloader: "
        "install ours by ISP (firmware/bootloader/README.md).");
  }
  return *board;
}

Board FlashProcedure::AskSketch(const FoundBoard& found) {
  hooks_.say("asking the Arduino program to start its bootloader");
  hooks_.ask_sketch(found.board.port);
  const std::optional<Board> board = WaitFor(found, kChangeMs, /*firmware=*/false);
  if (!board) {
    throw FlashUnfinished(Where(found.board) +
                          ": the program did not start its bootloader. Nothing was written. Reset "
                          "the board (a Pro Micro twice within a second) and run torquer-flash "
                          "without --port within 8 s.");
  }
  return *board;
}

void FlashProcedure::WriteByBootloader(const Board& board, const FlashImage& image) {
  const int pages = image.pages();
  const char* state = kUntouched;
  std::string doing = "before the first page was written";
  const auto begin = [&](const char* what, int page) {
    StopIfWanted(std::string(state) + kAgain);
    doing = fmt::format("while page {} of {} was {}", page + 1, pages, what);
  };
  try {
    const auto link = boards_.Open(board);
    const auto status = Get<BootloaderStatusReport>(*link, protocol::kBootloaderStatusReportId);
    if (status.board != image.board()) {
      Command(*link, protocol::kBootloaderRestart);
      throw UserError(BoardRefused(status.board, image.board()));
    }
    if (status.clock != image.trailer().clock) {
      Command(*link, protocol::kBootloaderRestart);
      throw UserError(BootloaderRefuses(protocol::CpuMhz(status.clock), image.cpu_mhz()));
    }
    for (int i = 0; i < pages; ++i) {
      begin("written", i);
      state = i == 0 ? kOldOrNone : kNoApplication;
      WritePage(*link, image, i);
      state = kNoApplication;
      hooks_.progress("writing", i + 1, pages);
    }
    Command(*link, protocol::kBootloaderSelectPage, 0);
    for (int i = 0; i < pages; ++i) {
      begin("verified", i);
      const auto report = Get<PageReport>(*link, protocol::kPageReportId);
      const std::vector<std::uint8_t> page = image.Page(i);
      if (report.address != image.PageAddress(i) ||
          !std::equal(page.begin(), page.end(), report.data)) {
        throw FlashUnfinished(
            fmt::format("page {} does not read back as it was written. {}{} If "
                        "that does not help, the chip's flash is worn out.",
                        i + 1, state, kAgain));
      }
      hooks_.progress("verifying", i + 1, pages);
    }
    doing = "while the image was made valid";
    state = kNewOrNone;
    WritePage(*link, image, pages);
    doing = "before it restarted";
    state = kNew;
    Command(*link, protocol::kBootloaderRestart);
  } catch (const BoardLost& lost) {
    throw FlashUnfinished(
        fmt::format("the board was lost {} ({}). {}{}", doing, lost.what(), state, kAgain));
  } catch (const ReportRefused& refused) {
    throw FlashUnfinished(fmt::format("the bootloader refused a report {} ({}). {}{}", doing,
                                      refused.what(), state, kAgain));
  }
}

// Warning if the supply is certainly too low for 16 MHz; empty otherwise, and if it is not known.
std::string FlashProcedure::JudgeSupply(const Board& board, const FlashImage& image) {
  constexpr int kNeeded_mv = 4500, kLowest_mv = 4090;  // the reference is off by up to 10 %
  if (image.cpu_mhz() != 16) return {};
  boards_.Sleep(kSupplyMs);
  try {
    const auto link = boards_.Open(board);
    const int supply_mv =
        Get<protocol::DiagnosticsReport>(*link, protocol::kDiagnosticsReportId).supply_mv;
    if (supply_mv == 0 || supply_mv >= kLowest_mv) return {};
    return fmt::format(
        "its supply is about {:.1f} V, and a CPU of 16 MHz needs {:.1f} V: install "
        "torquer-firmware-16to8mhz.hex",
        supply_mv * 1e-3, kNeeded_mv * 1e-3);
  } catch (const std::runtime_error&) {  // no error: the firmware runs, and its supply is not known
    return {};
  }
}

FlashOutcome FlashProcedure::ReadSelfTest(const FoundBoard& before, const FlashImage& image) {
  hooks_.say("waiting for the new firmware");
  const auto no_answer = [](const std::string& why) {
    return FlashUnfinished(
        "the image is written and valid, but " + why +
        " Unplug the board and plug it in; if it is not seen then, reset it by "
        "its reset pin, which enters the bootloader, and install another image.");
  };
  const std::optional<Board> board = WaitFor(before, kChangeMs, /*firmware=*/true);
  if (!board) throw no_answer("the new firmware does not appear.");
  IdentityReport identity{};
  for (int waited = 0;; waited += kLookMs) {
    try {
      const auto link = boards_.Open(*board);
      identity = Get<IdentityReport>(*link, protocol::kIdentityReportId);
    } catch (const std::runtime_error& error) {
      if (waited >= kSensorMs) throw no_answer(fmt::format("does not answer: {}.", error.what()));
    }
    if ((identity.self_test & kSensorGood) || waited >= kSensorMs) break;
    boards_.Sleep(kLookMs);
  }
  FlashOutcome outcome;
  outcome.version = {identity.firmware_major, identity.firmware_minor, identity.firmware_patch};
  outcome.serial = board->serial;
  outcome.application_good = identity.self_test & kApplicationGood;
  outcome.settings_good = identity.self_test & kSettingsGood;
  outcome.sensor_good = identity.self_test & kSensorGood;
  if (identity.capabilities & protocol::kCapabilitySecondSensor) {
    outcome.second_sensor_good = (identity.self_test & kSecondSensorGood) != 0;
  }
  if (outcome.version != image.version() || !outcome.application_good) {
    throw FlashUnfinished(fmt::format(
        "{}: firmware {} answers, its own CRC check {}, but firmware {} was written. {}",
        outcome.serial, outcome.version.Text(), outcome.application_good ? "good" : "failed",
        image.version().Text(), kAgain));
  }
  outcome.supply_warning = JudgeSupply(*board, image);
  return outcome;
}

}  // namespace torquer::tools
