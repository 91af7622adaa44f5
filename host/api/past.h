// Record of all actions on a simulation since its start, by which it can be repeated.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "host/api/torquer/torquer.h"

namespace torquer {

/// Steps, exchanges and rendered pictures, encoded in bytes. Renderings count because a picture can
/// be the mask of later ones. A copy is cheap: it shares all but the newest bytes. Different
/// threads may use copies independently.
class Past {
 public:
  Past() = default;
  /// A copy made within a step has the ticks of that step so far.
  Past(const Past& other);
  Past& operator=(const Past& other);
  Past(Past&&) noexcept = default;
  Past& operator=(Past&&) noexcept = default;
  ~Past() = default;

  /// Begins a step to `row`.
  void BeginStep(const Command& row);
  void AddTick();
  void EndStep();
  /// A picture of a plane was rendered, within a step or after it.
  void AddRendering(int plane);
  /// An instrument was exchanged between two steps. `scene_hash`: of the scene since then.
  void AddExchange(int instrument, const std::string& device, std::uint64_t scene_hash);

  std::string Bytes() const;

  /// Actions that repeat a past.
  struct Actions {
    /// Steps to `row`, and calls `after_tick` with the number of each tick, from 1. Ends the step
    /// if it returns false. Returns the number of ticks.
    std::function<std::uint32_t(const Command& row, const std::function<bool(std::uint32_t)>&)>
        step;
    std::function<void(int plane)> render;
    std::function<void(std::size_t instrument, const std::string& device, std::uint64_t scene_hash)>
        exchange;
  };
  /// Repeats the past of Bytes() for a scene of `hands` instruments. Throws Error for other bytes.
  static void Repeat(std::string_view bytes, std::size_t hands, const Actions& actions);

 private:
  // Bytes that many pasts share. They follow the bytes of `before`.
  struct Block {
    Block(std::shared_ptr<const Block> earlier, std::string contents)
        : before(std::move(earlier)), bytes(std::move(contents)) {}
    Block(const Block&) = delete;
    Block& operator=(const Block&) = delete;
    ~Block();

    std::shared_ptr<const Block> before;
    const std::string bytes;
  };
  struct OpenStep {
    Command row;
    std::uint32_t ticks = 0;
    std::vector<std::pair<std::uint32_t, int>> renderings;  // tick and plane
  };

  void Write(const OpenStep& step);

  std::shared_ptr<const Block> blocks_;
  std::string newest_;
  Command last_;  // whose controls the next step may repeat
  std::unique_ptr<OpenStep> open_;
};

}  // namespace torquer
