// Reading an AVR ELF file: the bytes for the flash, and the symbols.
#include "host/emulator/firmware_image.h"

#include <fcntl.h>
#include <gelf.h>
#include <libelf.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "host/support/error.h"
#include "host/support/installed.h"
#include "protocol/firmware_image.h"

namespace torquer::emulator {
namespace {

constexpr std::size_t kFlashBytes = 32768;
constexpr std::size_t kFirstBootSection = 0x7000;

struct ElfFile {
  explicit ElfFile(const std::string& path) : descriptor(open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (descriptor < 0) {
      throw UserError(path + ": cannot open the firmware image (" + std::strerror(errno) +
                      "). Build it with `cmake --build --preset release`, or name one with "
                      "--firmware.");
    }
    elf_version(EV_CURRENT);
    elf = elf_begin(descriptor, ELF_C_READ, nullptr);
    GElf_Ehdr header;
    if (!elf || elf_kind(elf) != ELF_K_ELF || !gelf_getehdr(elf, &header) ||
        header.e_machine != EM_AVR) {
      Close();
      throw UserError(path +
                      ": not an ELF file for AVR. Name the .elf that the firmware's build made.");
    }
  }
  ~ElfFile() { Close(); }
  ElfFile(const ElfFile&) = delete;
  ElfFile& operator=(const ElfFile&) = delete;

  void Close() {
    if (elf) elf_end(elf);
    if (descriptor >= 0) close(descriptor);
    elf = nullptr;
    descriptor = -1;
  }

  int descriptor;
  Elf* elf = nullptr;
};

}  // namespace

FirmwareImage::FirmwareImage(const std::string& elf_path) : path_(elf_path) {
  ElfFile file(elf_path);
  std::size_t lowest = kFlashBytes;
  std::size_t count = 0;
  elf_getphdrnum(file.elf, &count);
  for (std::size_t i = 0; i < count; ++i) {
    GElf_Phdr segment;
    if (!gelf_getphdr(file.elf, static_cast<int>(i), &segment)) continue;
    if (segment.p_type != PT_LOAD || segment.p_filesz == 0 || segment.p_paddr >= kFlashBytes) {
      continue;
    }
    const std::size_t end = segment.p_paddr + segment.p_filesz;
    if (end > kFlashBytes) throw UserError(path_ + ": the image is larger than the chip's flash.");
    if (flash_.size() < end) flash_.resize(end, 0xff);
    lowest = std::min(lowest, static_cast<std::size_t>(segment.p_paddr));
    if (pread(file.descriptor, flash_.data() + segment.p_paddr, segment.p_filesz,
              static_cast<off_t>(segment.p_offset)) != static_cast<ssize_t>(segment.p_filesz)) {
      throw UserError(path_ + ": the file is cut short. Build it again.");
    }
  }
  if (flash_.empty()) throw UserError(path_ + ": the image has no bytes for the flash.");

  if (lowest >= kFirstBootSection) boot_start_ = static_cast<std::uint32_t>(lowest);

  Elf_Scn* section = nullptr;
  while ((section = elf_nextscn(file.elf, section)) != nullptr) {
    GElf_Shdr header;
    gelf_getshdr(section, &header);
    if (header.sh_type != SHT_SYMTAB) continue;
    Elf_Data* data = elf_getdata(section, nullptr);
    for (std::size_t i = 0; i < header.sh_size / header.sh_entsize; ++i) {
      GElf_Sym symbol;
      gelf_getsym(data, static_cast<int>(i), &symbol);
      const char* name = elf_strptr(file.elf, header.sh_link, symbol.st_name);
      if (name && *name) symbols_[name] = static_cast<std::uint32_t>(symbol.st_value);
    }
  }
  ReadBuild();
}

void FirmwareImage::ReadBuild() {
  if (!HasSymbol("torquer_cpu_hz")) return;
  cpu_hz_ = ClockNamed("torquer_cpu_hz");
  crystal_hz_ = ClockNamed("torquer_crystal_hz");
  if (!HasSymbol("torquer_image_board")) return;
  const std::uint32_t address = Symbol("torquer_image_board");
  if (address < flash_.size()) board_ = flash_[address];
}

std::uint32_t FirmwareImage::ClockNamed(const std::string& symbol) const {
  const std::uint32_t address = Symbol(symbol);
  std::uint32_t clock_hz = 0;
  if (address + sizeof(clock_hz) <= flash_.size()) {
    std::memcpy(&clock_hz, &flash_[address], sizeof(clock_hz));
  }
  if (clock_hz != 8000000 && clock_hz != 16000000) {
    throw UserError(path_ + ": " + symbol + " is " + std::to_string(clock_hz) +
                    ", where 8 or 16 MHz were expected.");
  }
  return clock_hz;
}

std::string FirmwareImage::OfThisBuild() {
  return FindInstalled("share/torquer/firmware/torquer-firmware.elf");
}

FirmwareImage FirmwareImage::Load(const std::string& application_elf,
                                  const std::string& bootloader_elf) {
  if (application_elf.empty()) return FirmwareImage(bootloader_elf);
  FirmwareImage image(application_elf);
  if (!bootloader_elf.empty()) image.Add(FirmwareImage(bootloader_elf));
  return image;
}

std::uint32_t FirmwareImage::Symbol(const std::string& name) const {
  const auto found = symbols_.find(name);
  if (found == symbols_.end()) {
    throw UserError(path_ + ": no symbol `" + name +
                    "`. Use an image of this project with its symbols (not stripped).");
  }
  return found->second;
}

void FirmwareImage::Add(const FirmwareImage& other) {
  if (cpu_hz() != other.cpu_hz() || crystal_hz() != other.crystal_hz()) {
    const auto clocks = [](const FirmwareImage& image) {
      return "a CPU of " + std::to_string(image.cpu_hz() / 1000000) + " MHz and a crystal of " +
             std::to_string(image.crystal_hz() / 1000000) + " MHz";
    };
    throw UserError(other.path_ + ": built for " + clocks(other) + ", but " + path_ + " for " +
                    clocks(*this) + ". Give an application and a bootloader for the same clocks.");
  }
  flash_.resize(std::max(flash_.size(), other.flash_.size()), 0xff);
  for (std::size_t i = 0; i < other.flash_.size(); ++i) {
    if (other.flash_[i] == 0xff) continue;
    if (flash_[i] != 0xff) {
      throw UserError(other.path_ + ": lies where " + path_ +
                      " does. Give one application and one bootloader.");
    }
    flash_[i] = other.flash_[i];
  }
  symbols_.insert(other.symbols_.begin(), other.symbols_.end());
  boot_start_ = std::max(boot_start_, other.boot_start_);
}

void FirmwareImage::SetInitialValue(const std::string& variable, std::uint32_t value) {
  const std::uint32_t address =
      Symbol(variable) - Symbol("__data_start") + Symbol("__data_load_start");
  if (address + sizeof(value) > flash_.size()) {
    throw UserError(path_ + ": `" + variable + "` is not among the initialized variables.");
  }
  std::memcpy(&flash_[address], &value, sizeof(value));
  SignAnew();
}

// The image is another now, and a good one.
void FirmwareImage::SignAnew() {
  using protocol::ImageTrailer;
  if (flash_.size() < protocol::kImageTrailerAddress + sizeof(ImageTrailer)) return;
  std::uint8_t* place = &flash_[protocol::kImageTrailerAddress];
  ImageTrailer trailer;
  std::memcpy(&trailer, place, sizeof(trailer));
  if (trailer.magic != protocol::kImageMagic) return;
  trailer.crc = protocol::ImageCrc(trailer, [this](std::uint16_t at) { return flash_[at]; });
  std::memcpy(place, &trailer, sizeof(trailer));
}

}  // namespace torquer::emulator
