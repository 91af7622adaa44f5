#include <fmt/format.h>
#include <link.h>

#include <cstdint>
#include <cstring>
#include <string_view>

#include "host/api/impl.h"
#include "host/support/fnv1a.h"
#include "torquer_version.h"

namespace torquer {

namespace {

// Every saved simulation begins with this, and the hash of all that follows in 16 digits.
constexpr std::string_view kMagic = "torquer simulation 1 ";
constexpr std::size_t kHexDigits = 16;

// Finds the note with the build's hash in the object that has this function.
int TakeBuild(dl_phdr_info* object, std::size_t /*size*/, void* out) {
  const auto here = reinterpret_cast<std::uintptr_t>(&TakeBuild);
  bool is_here = false;
  for (int k = 0; k < object->dlpi_phnum; ++k) {
    const auto& segment = object->dlpi_phdr[k];
    const std::uintptr_t begin = object->dlpi_addr + segment.p_vaddr;
    is_here |= segment.p_type == PT_LOAD && here >= begin && here < begin + segment.p_memsz;
  }
  if (!is_here) return 0;
  for (int k = 0; k < object->dlpi_phnum; ++k) {
    const auto& segment = object->dlpi_phdr[k];
    if (segment.p_type != PT_NOTE) continue;
    const auto* at = reinterpret_cast<const char*>(object->dlpi_addr + segment.p_vaddr);
    const char* const end = at + segment.p_memsz;
    while (end - at > static_cast<std::ptrdiff_t>(sizeof(ElfW(Nhdr)))) {
      ElfW(Nhdr) note;
      std::memcpy(&note, at, sizeof(note));
      const auto padded = [](std::size_t bytes) { return (bytes + 3) / 4 * 4; };
      const char* const contents = at + sizeof(note) + padded(note.n_namesz);
      at = contents + padded(note.n_descsz);
      if (note.n_type != NT_GNU_BUILD_ID) continue;
      for (std::size_t byte = 0; byte < note.n_descsz; ++byte) {
        *static_cast<std::string*>(out) +=
            fmt::format("{:02x}", static_cast<unsigned char>(contents[byte]));
      }
      return 1;
    }
  }
  return 1;
}

// Contents of a saved simulation, before the bytes of its past.
struct Header {
  std::string build;
  std::string scene_hash;
  std::string state_hash;
};

std::string ToText(const Header& header) {
  return fmt::format("{} {} {}\n", header.build, header.scene_hash, header.state_hash);
}

[[noreturn]] void RefuseDamaged() { throw Error("the saved simulation is damaged; save it again"); }

// Takes the header from `bytes`, which keeps the past.
Header TakeHeader(std::string_view& bytes) {
  if (bytes.size() < kMagic.size() + kHexDigits || bytes.substr(0, kMagic.size()) != kMagic) {
    throw Error("these bytes are not a saved simulation; give those of Simulation::Save");
  }
  const std::string_view hash = bytes.substr(kMagic.size(), kHexDigits);
  bytes.remove_prefix(kMagic.size() + kHexDigits);
  if (Hex(Fnv1a(bytes)) != hash) RefuseDamaged();
  Header header;
  for (std::string* const field : {&header.build, &header.scene_hash, &header.state_hash}) {
    const std::size_t end = bytes.find_first_of(" \n");
    if (end == std::string_view::npos) RefuseDamaged();
    *field = bytes.substr(0, end);
    bytes.remove_prefix(end + 1);
  }
  return header;
}

}  // namespace

std::string Build() {
  static const std::string build = [] {
    std::string found;
    dl_iterate_phdr(TakeBuild, &found);
    // The linker of this project writes the note; a foreign one may not.
    return found.empty() ? std::string(kVersion) : found;
  }();
  return build;
}

std::string Simulation::Save() const {
  const auto hold = impl().usage.Look();
  const std::string contents = ToText({.build = Build(),
                                       .scene_hash = Hex(impl_->scene_at_start.content_hash()),
                                       .state_hash = Hex(impl_->simulation->state_hash())}) +
                               impl_->past.Bytes();
  return std::string(kMagic) + Hex(Fnv1a(contents)) + contents;
}

namespace {

// Repeats an exchange. Its device may have other values than then.
void RepeatExchange(std::size_t instrument, const std::string& device, std::uint64_t scene_hash,
                    Simulation& simulation) {
  simulation.Exchange(simulation.scene().instruments()[instrument].name, device);
  if (simulation.scene().content_hash() == scene_hash) return;
  throw Error(
      fmt::format("the simulation was saved with other values of the device {}; load it with the "
                  "devices that it had then",
                  device));
}

}  // namespace

Simulation Simulation::Load(const Scene& scene, const std::string& saved,
                            const std::function<void()>& after_tick) {
  std::string_view bytes = saved;
  const Header header = TakeHeader(bytes);
  if (header.build != Build()) {
    throw Error(fmt::format(
        "the simulation was saved by the build {} of Torquer, but this is {}, which may find other "
        "states; load it with the build that saved it",
        header.build, Build()));
  }
  if (header.scene_hash != Hex(scene.content_hash())) {
    throw Error(fmt::format(
        "the simulation was saved with other contents of a scene than {} has; give its own scene",
        scene.name()));
  }
  Simulation simulation(scene);
  Past::Repeat(bytes, scene.instruments().size(),
               {.step =
                    [&](const Command& row, const std::function<bool(std::uint32_t)>& go_on) {
                      std::uint32_t ticks = 0;
                      simulation.Step(row, [&](const StepReport&) {
                        if (after_tick) after_tick();
                        return go_on(++ticks);
                      });
                      return ticks;
                    },
                .render = [&](int plane) { simulation.LastPicture(plane); },
                .exchange =
                    [&](std::size_t instrument, const std::string& device, std::uint64_t hash) {
                      RepeatExchange(instrument, device, hash, simulation);
                    }});
  if (Hex(simulation.state_hash()) == header.state_hash) return simulation;
  throw Error(
      "the repeated commands of the saved simulation give another state; this processor calculates "
      "differently, so save and load on machines of one kind");
}

}  // namespace torquer
