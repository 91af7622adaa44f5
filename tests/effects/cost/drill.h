// Hand motion that both programs share.
#pragma once

namespace torquer::test {

inline constexpr int kTicks = 400;
inline constexpr double kTickS = 0.005;  // the time of moving vessels; the wire needs none
inline constexpr double kFeedMm = 0.3;
inline constexpr double kTurnRad = 0.01;

}  // namespace torquer::test
