// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "store/take.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_folder.h"

namespace raystage {

/// `rows` x `columns` cameras of 960x640, 61.5 mm apart as those of the light field shop, that look
/// at a painted plane 5 m off in a scene from 3 to 40 m; JPEG of quality 90 with restart markers.
testing::SyntheticTake make_painted_rig(int rows, int columns);

/// A take to measure on.
class BenchTake {
 public:
  /// The take in the folder that the environment variable names; written anew where it is unset.
  BenchTake(const char* variable, const testing::SyntheticTake& written);
  /// Written anew.
  explicit BenchTake(const testing::SyntheticTake& written);

  const Take& take() const { return *take_; }

 private:
  TestFolder folder_;
  std::unique_ptr<Take> take_;
};

}  // namespace raystage
