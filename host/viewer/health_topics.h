// Health topics: separates the processes that a session needs from all others that report their
// health on the bus. No I/O.
#pragma once

#include <string>
#include <torquer_lcm/health_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <vector>

namespace torquer::viewer {

/// Any program may choose any name on the bus. The session needs the simulator, the emulator, and a
/// daemon for each instrument of the scene.
class HealthTopics {
 public:
  static constexpr std::size_t kMostInstruments = 16;

  /// Returns the topics of instruments that the scene no longer has.
  std::vector<std::string> Add(const torquer_lcm::scene_description_t& scene);
  /// True if the session needs this process.
  bool Needs(const torquer_lcm::health_t& health) const;
  /// True if the scene has this instrument, and for every instrument before the scene is known.
  bool HasInstrument(const std::string& name) const;

  static std::string TopicOf(const torquer_lcm::health_t& health);

 private:
  std::vector<std::string> instruments_;
};

}  // namespace torquer::viewer
