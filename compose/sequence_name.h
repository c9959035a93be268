// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace raystage {

/// The name of an image sequence: a path whose file name holds the place of the frame number.
///
/// "####" stands for that many digits with leading zeros (a single "#" for four, as in fileseq and
/// OpenImageIO), each "@" for one digit, "%04d" and "%d" as in printf. More digits are used where a
/// frame needs them; a minus sign counts as one place ("-005"), as in printf.
class SequenceName {
 public:
  /// Throws Error (bad input) for two frame tokens, one in a folder's name, or an unknown "%".
  explicit SequenceName(std::string_view pattern);

  bool has_frame_token() const { return has_token_; }
  /// Number of digits, at least; 0 without a token.
  int padding() const { return padding_; }
  const std::string& pattern() const { return pattern_; }
  std::filesystem::path folder() const;
  /// Of another sequence beside this one: `word` and a dot before the number, or before the file's
  /// extension where there is none ("a.####.exr", "deep": "a.deep.####.exr").
  SequenceName with(std::string_view word) const;
  /// Path of a frame; the same for every frame without a token.
  std::filesystem::path path(int frame) const;
  /// The frame that a file name (without folder) stands for, nullopt where it is not of this
  /// sequence.
  std::optional<int> frame_from_file_name(std::string_view file_name) const;

 private:
  std::string number(int frame) const;

  std::string pattern_, before_, after_;  ///< before_ holds the folder too
  bool has_token_ = false;
  int padding_ = 0;
};

}  // namespace raystage
