// Student's t: how many standard errors a 95 % interval needs when the error itself is estimated
// from a few strokes.
#pragma once

namespace torquer::calibration {

/// Half width of the interval that holds 95 % of Student's t distribution with `degrees_of_freedom`
/// (need not be whole; >= 0.5, infinity gives the normal distribution's 1.96). Off by less than
/// 1e-6 of its value.
double StudentHalfWidth95(double degrees_of_freedom);

}  // namespace torquer::calibration
