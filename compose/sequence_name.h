// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace raystage::compose {

/// The name of an image sequence: a path whose file name contains a token for the frame number.
///
/// "####" is a number with at least that many digits, zero-padded. A single "#" is four digits, as
/// in fileseq and OpenImageIO. Each "@" is one digit; "%04d" and "%d" are as in printf. Larger
/// frame numbers get more digits; a minus sign counts as a digit ("-005"), as in printf.
class SequenceName {
 public:
  /// Throws Error (bad input) for two frame tokens, one in a folder name, or an unknown "%".
  explicit SequenceName(std::string_view pattern);

  bool has_frame_token() const { return has_token_; }
  /// Returns the smallest number of digits; 0 without a token.
  int padding() const { return padding_; }
  const std::string& pattern() const { return pattern_; }
  std::filesystem::path folder() const;
  /// Returns the name of an accompanying sequence, with `word` and a dot before the number, or
  /// before the file's extension if there is no number ("a.####.exr", "deep": "a.deep.####.exr").
  SequenceName with(std::string_view word) const;
  /// Returns the path of a frame; without a token the same for every frame.
  std::filesystem::path path(int frame) const;
  /// Returns the frame of a file name (without folder), or nullopt if it is not of this sequence.
  std::optional<int> frame_from_file_name(std::string_view file_name) const;

 private:
  std::string number(int frame) const;

  std::string pattern_, before_, after_;  ///< before_: with the folder
  bool has_token_ = false;
  int padding_ = 0;
};

}  // namespace raystage::compose
