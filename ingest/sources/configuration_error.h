// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "base/error.h"

namespace raystage::ingest {

/// An error in what a configuration says of a source (an unknown option, a bad address), or a
/// permission that this user lacks: every other attempt would fail in the same way. Faults of a
/// camera, and whatever a camera sends, are other Errors.
class ConfigurationError : public Error {
 public:
  explicit ConfigurationError(Error error) : Error(std::move(error)) {}
};

}  // namespace raystage::ingest
