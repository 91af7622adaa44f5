// Errors that the user or a device causes, and that the user can remedy.
#pragma once

#include <stdexcept>

namespace torquer {

/// Error for input of the user, or behavior of a device, that cannot be used. The message of
/// `what()` names the file, line or field, the value, and the remedy, in one or more sentences.
/// Programs print it and exit with kExitUserError (host/support/program.h).
class UserError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace torquer
