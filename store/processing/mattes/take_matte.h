// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "schemas/matte_settings.h"
#include "store/processing/frames/frame_matte.h"
#include "store/take.h"

namespace raystage::store {

/// The matte of a take, by the settings of a shot's layer. The clean plate of a camera is computed
/// when one of its frames is first decoded, and stays in memory: 6 bytes per pixel if it comes from
/// an empty take.
class TakeMatte : public FrameMatte {
 public:
  /// Keeps a reference to `take`. `folder`: paths in the settings are relative to it. Throws Error
  /// (bad input) if the empty take does not have the same cameras.
  TakeMatte(const Take& take, const schemas::MatteSettings& settings,
            const std::filesystem::path& folder);
  ~TakeMatte() override;

  std::unique_ptr<const FrameKeyer> make_keyer(int camera, int frame,
                                               const CodeScale& scale) const override;

  /// Returns the files, in addition to archives, that are read for a frame.
  std::vector<std::filesystem::path> input_files(int camera, int frame) const;
  /// Returns the memory in bytes that clean plates and masks of all cameras need.
  std::size_t bytes() const;
  /// Returns a text that identifies the inputs of the mattes in addition to the settings: the
  /// hashes of the frames from which clean plates are computed.
  std::string sources() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::store
