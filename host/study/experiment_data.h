// Published measurements on slender rods, each with its source.
#pragma once

#include <array>

namespace torquer::study {

/// Steel strip, clamped horizontally at one end, bent by its own weight and a weight on its free
/// end.
///
/// T. Belendez, C. Neipp and A. Belendez, Int. J. Engng Ed. 19 (2003) 885-892. "Numerical and
/// Experimental Analysis of a Cantilever Beam: a Laboratory Project to Introduce Geometric
/// Nonlinearity in Mechanics of Materials". Every figure was read in solids4foam/beamFoam, commit
/// 4ef3f7d. Its tutorials/largeDeflectionCantilever/README.md repeats the paper's table.
namespace strip {

inline constexpr double kLengthMm = 400;
inline constexpr double kWidthMm = 25;
inline constexpr double kThicknessMm = 0.4;
inline constexpr double kYoungGPa = 194.3;  ///< fitted by the authors to this same strip
inline constexpr double kWeightN = 0.3032;  ///< weight of the whole strip
/// The source states no error. The readings are given to a millimeter; the same is assumed for the
/// length.
inline constexpr double kReadingMm = 1;

struct Reading {
  double force_N;      ///< force on the free end, downward
  double measured_mm;  ///< distance of the free end below the clamp
};
inline constexpr std::array<Reading, 7> kReadings = {
    {{0, 89}, {0.098, 149}, {0.196, 195}, {0.294, 227}, {0.392, 251}, {0.490, 268}, {0.588, 281}}};

}  // namespace strip

/// Steel needle with curvature sensors inside, 90 mm deep in a phantom that bends it to one side.
///
/// dlezcan1/shape-sensing, commit 4a6abd5, src/needleshape_fmincon_v2.m (by J. S. Kim), experiment
/// 1, single bend: rod, sensor positions, sensor readings, and the tip's deflection. The file
/// src/main_singlebend_v2_tissue_90total.m of the same commit assigns the sensors to their
/// positions. It also says that the data was used for ICRA 2017. In the model there the phantom
/// loads the needle uniformly. The curvature is then proportional to the square of the distance
/// from the tip.
namespace needle {

inline constexpr double kLengthMm = 90;
inline constexpr double kDiameterMm = 0.9;
inline constexpr double kYoungGPa = 200;  ///< stainless steel 304
/// Distances from the needle's entry point. A third sensor, at 79 mm, reads less than its own
/// noise.
inline constexpr std::array<double, 2> kSensorsMm = {20, 64};

struct Insertion {
  double tip_mm;                            ///< deflection of the tip; the source states no error
  std::array<double, 2> in_plane_1_per_mm;  ///< curvature in the plane of the bend
  std::array<double, 2> out_of_plane_1_per_mm;  ///< curvature across this plane, ideally zero
};
inline constexpr std::array<Insertion, 7> kInsertions = {{
    {5.1224, {0.001409425, 0.000190242}, {-6.56572e-05, -3.20545e-05}},
    {5.1056, {0.001399409, 0.000214456}, {6.71027e-05, 7.09877e-05}},
    {5.2760, {0.001454885, 0.000198112}, {-0.000209859, 2.802e-05}},
    {5.3332, {0.00149648, 6.89087e-05}, {4.06711e-05, 8.22363e-05}},
    {4.1023, {0.001118877, 9.74258e-05}, {1.72744e-05, 7.74086e-05}},
    {4.7046, {0.001308601, 8.55429e-05}, {4.84661e-05, 0.000196857}},
    {4.7820, {0.001319828, 0.000166501}, {-6.01577e-05, 0.000185959}},
}};

}  // namespace needle

/// Round bars compressed between two clamps until they buckle.
///
/// s-aclaux/Various-Specimen-Buckling-Laboratory, commit 850c7f6, scripts/MoMBucklingLabCode.m: a
/// laboratory report of an undergraduate at the University of Washington. It has moduli, sections,
/// end conditions (effective length half the length), slenderness and peak stress of every
/// specimen. No errors are stated, and only one specimen of each kind was tested.
namespace columns {

struct Bar {
  const char* metal;
  double young_GPa;  ///< nominal
  double area_mm2;
  double second_moment_mm4;
  /// Strength of the metal: peak stress of the shortest specimen, slenderness 29.
  double bears_MPa;
};
inline constexpr Bar kAluminum = {"aluminum", 68.947, 31.76919859, 80.31769662, 303.5552069};
inline constexpr Bar kSteel = {"steel", 200, 31.19248072, 77.42887132, 706.534528};

struct Specimen {
  const Bar& bar;
  double slenderness;  ///< length over radius of gyration
  double peak_MPa;
};
/// Specimens that buckle before they yield; the others do not depend on bending alone.
inline constexpr std::array<Specimen, 6> kSpecimens = {{{kAluminum, 151.6981131, 136.9937201},
                                                        {kAluminum, 214.254317, 66.45888579},
                                                        {kAluminum, 314.2586749, 26.91182389},
                                                        {kSteel, 152.063492, 360.4497065},
                                                        {kSteel, 217.3608902, 184.3808051},
                                                        {kSteel, 315.8925749, 98.18438164}}};

}  // namespace columns

/// Guidewire pushed into a stiff phantom with a T and a Y, compared with the simulated wire.
///
/// Baier, Baier-Saip, Schilling and Oliveira, "Simulator for Minimally Invasive Vascular
/// Interventions", Presence 25(2), 2016, section 4.1 and Fig. 12.
namespace phantom {

inline constexpr double kMeanMm = 0.262;       ///< average separation of the two wires
inline constexpr double kDeviationMm = 0.227;  ///< its standard deviation along the wire
inline constexpr double kSegmentMm = 1;
inline constexpr int kCycles = 100;  ///< cycles of Physical and Geometrical Relaxation

}  // namespace phantom

}  // namespace torquer::study
