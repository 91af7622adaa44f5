#include "host/support/unit_of_name.h"

#include <catch2/catch.hpp>

using torquer::UnitOfName;

TEST_CASE("A name ends with its unit", "[support]") {
  CHECK(UnitOfName("nodes_mm") == "mm");
  CHECK(UnitOfName("guidewire.rotation_rad") == "rad");
  CHECK(UnitOfName("max_penetration_um") == "um");
  CHECK(UnitOfName("pressure_mean_mmHg") == "mmHg");
  CHECK(UnitOfName("wall_force_impulse_mNs") == "mN s");
}

TEST_CASE("Units of two parts are products, but of loads, speeds and rates quotients",
          "[support]") {
  CHECK(UnitOfName("bending_mN_mm") == "mN mm");
  CHECK(UnitOfName("kerma_area_Gy_cm2") == "Gy cm2");
  CHECK(UnitOfName("wall_line_load_mN_mm") == "mN/mm");
  CHECK(UnitOfName("mean_speed_mm_s") == "mm/s");
  CHECK(UnitOfName("injector_rate_mL_s") == "mL/s");
  CHECK(UnitOfName("heart_rate_per_min") == "1/min");
}

TEST_CASE("Names without a unit have the unit 1", "[support]") {
  for (const char* const name : {"residual", "state_hash", "injections", "mm", ""}) {
    CHECK(UnitOfName(name) == "1");
  }
}
