// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "schemas/matte_settings.h"
#include "store/processing/frames/frame_matte.h"
#include "store/take.h"

namespace raystage {

/// What shows of a take's frames, by the settings of a shot's layer. What a camera's empty set
/// looks like is found when one of its frames is first decoded, and kept: 6 bytes a pixel where it
/// comes from an empty take.
class TakeMatte : public FrameMatte {
 public:
  /// Throws Error (bad input) for an empty take with other cameras. `take` must live on. `folder`:
  /// that paths of the settings are relative to.
  TakeMatte(const Take& take, const MatteSettings& settings, const std::filesystem::path& folder);
  ~TakeMatte() override;

  std::unique_ptr<const FrameKey> key_of(int camera, int frame,
                                         const CodeScale& scale) const override;

  /// Files beside the archives that are read for a frame of a camera.
  std::vector<std::filesystem::path> files_read(int camera, int frame) const;
  /// Of memory that is kept, once all cameras have been looked at.
  std::size_t bytes() const;
  /// What else the mattes depend on, beside the settings: frames they are found from.
  std::string sources() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage
