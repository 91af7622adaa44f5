// Steering from the page: integrates rates to absolute commands for each instrument. No I/O, no
// clock: the caller passes the time of bus::MonotonicUs(), which must not decrease.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <torquer_lcm/exchange_command_t.hpp>
#include <torquer_lcm/imaging_command_t.hpp>
#include <torquer_lcm/injector_command_t.hpp>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/readings_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <torquer_lcm/table_command_t.hpp>
#include <torquer_lcm/wedge_command_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>
#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/viewer/page_id.h"
#include "host/viewer/page_messages.h"

namespace torquer::viewer {

/// One page steers at a time: the first that sends controls. It steers until it is gone or silent
/// for kReleaseUs. Each message of the page is valid for kSilentUs. After that all motion stops,
/// and the pedals are up.
class Steering {
 public:
  static constexpr std::int64_t kSilentUs = 300'000;
  static constexpr std::int64_t kReleaseUs = 1'000'000;
  /// A message may be lost, but a later simulator must not get the order.
  static constexpr std::int64_t kOrderUs = 1'500'000;
  /// Travel of the C-arm, as with a bench device.
  static constexpr double kLaoLimitRad = 1.5707963267948966;
  static constexpr double kCraLimitRad = 0.7853981633974483;

  explicit Steering(std::int64_t clock_id) : clock_id_(clock_id) {}

  /// Sets the instruments of the scene; another list starts again.
  void Add(const torquer_lcm::scene_description_t& scene);
  /// Takes over the table's position from the readings before it is moved.
  void Add(const torquer_lcm::readings_t& readings);
  /// Call if another simulator starts. The instruments take the positions of its first state, the
  /// C-arm, the table and the X-ray system their start values. The steering page stays the same.
  void Restart();
  /// Chooses the plain display. The first picture of a scene's subtraction would be blank.
  void ChoosePlain();
  /// Takes over the positions of a state before the first command.
  void Add(const torquer_lcm::wire_state_t& state);

  /// Returns false without effect while another page steers.
  bool Take(PageId page, const Controls& controls, std::int64_t now_us);
  /// The same for a motion of the table by the page that steers. It lasts as long as the controls.
  bool Take(PageId page, const TableMotion& motion, std::int64_t now_us);
  /// The same for settings of the X-ray system, which hold until another choice.
  bool Take(PageId page, const ImagingChoice& choice);
  /// The same for an order to the power injector. It stands while its page is there. That page can
  /// always give the order kOff.
  bool Take(PageId page, const effects::Injector& injector);
  /// The same for an order to exchange an instrument of the scene, which is repeated for kOrderUs.
  bool Take(PageId page, const ExchangeChoice& choice, std::int64_t now_us);
  void Leave(PageId page);

  /// Moves on to `now_us`.
  void Advance(std::int64_t now_us);
  /// One command for each instrument; empty before a scene and a state are known.
  const std::vector<torquer_lcm::instrument_command_t>& Commands(std::int64_t now_us);

  /// Settings now: those of the acquisition while its pedal is down. Null before the first choice,
  /// and before the first acquisition.
  const torquer_lcm::imaging_command_t* ImagingCommand(std::int64_t now_us);

  /// Null before a wedge has moved.
  const torquer_lcm::wedge_command_t* WedgeCommand(std::int64_t now_us);

  /// Null before the first order.
  const torquer_lcm::injector_command_t* InjectorCommand(std::int64_t now_us);

  /// Null unless an exchange was ordered in the last kOrderUs.
  const torquer_lcm::exchange_command_t* ExchangeCommand(std::int64_t now_us);

  /// Null before the first motion, and unless `again` while the table is where the last one put it.
  const torquer_lcm::table_command_t* TableCommand(std::int64_t now_us, bool again);

  std::optional<PageId> page() const { return page_; }
  double lao_rad() const { return lao_rad_; }
  double cra_rad() const { return cra_rad_; }
  bool xray() const { return controls_.xray || controls_.acquisition; }
  /// True while the pedal of the acquisition is down.
  bool acquires() const { return controls_.acquisition; }
  bool contrast() const { return controls_.contrast; }
  /// Settings of the X-ray pedal, as they were chosen.
  const effects::Imaging& imaging() const { return imaging_; }
  const Acquisition& acquisition() const { return acquisition_; }
  /// Number of the newest choice of each page, taken or refused. The page then knows that
  /// `imaging()` is not older than its choice.
  std::vector<std::uint32_t> AnsweredChoices() const;

 private:
  struct Reach {
    double least_mm = 0;
    double most_mm = 0;
  };

  void MoveTable(double passed_s);

  std::int64_t clock_id_;
  std::vector<torquer_lcm::instrument_command_t> commands_;
  std::vector<Reach> reach_;
  bool placed_ = false;
  std::optional<PageId> page_;
  Controls controls_;
  TableMotion table_motion_;
  std::int64_t heard_us_ = 0;
  std::int64_t advanced_us_ = 0;
  double lao_rad_ = 0;
  double cra_rad_ = 0;
  effects::Table table_;
  bool table_moved_ = false;  // since the start
  torquer_lcm::table_command_t table_command_{};
  effects::Imaging imaging_;
  Acquisition acquisition_;
  bool chosen_ = false;  // or acquired
  bool wedges_moved_ = false;
  std::map<PageId, std::uint32_t> answered_;  // of the pages that are still there
  torquer_lcm::imaging_command_t imaging_command_{};
  torquer_lcm::wedge_command_t wedge_command_{};
  effects::Injector injector_;
  std::optional<PageId> injector_page_;  // that gave the newest order
  bool ordered_ = false;
  torquer_lcm::injector_command_t injector_command_{};
  std::optional<std::int64_t> exchange_us_;  // time of the newest order
  torquer_lcm::exchange_command_t exchange_command_{};
};

}  // namespace torquer::viewer
