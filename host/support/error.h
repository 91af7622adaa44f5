// Errors that are the user's or a device's to mend.
#pragma once

#include <stdexcept>
#include <string>

namespace torquer {

/// Something the user gave, or a device did, cannot be used. what() is one or more sentences that
/// name the file, line or field, the value, and the remedy. Programs print it and exit with 2.
class UserError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Exit status of a program that met a UserError.
inline constexpr int kExitUserError = 2;

}  // namespace torquer
