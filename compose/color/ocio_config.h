// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenColorIO/OpenColorIO.h>

#include <array>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace raystage::compose {

/// A transform of OpenColorIO. Thread-safe.
class OcioTransform {
 public:
  explicit OcioTransform(OCIO_NAMESPACE::ConstCPUProcessorRcPtr processor);

  /// Converts pixels of three or four values in place; a fourth stays.
  void apply(std::span<float> values, int channels) const;
  bool is_no_op() const { return is_no_op_; }
  /// Whether it maps some test colours as the matrix does, up to 1e-4.
  bool is_linear() const { return is_linear_; }
  /// The same, up to 2e-6: applying the matrix is as good.
  bool is_matrix() const { return is_matrix_; }
  /// What becomes of unit red, green and blue: the columns of the matrix.
  const std::array<std::array<float, 3>, 3>& columns() const { return columns_; }

 private:
  void measure();

  OCIO_NAMESPACE::ConstCPUProcessorRcPtr processor_;
  bool is_no_op_ = false, is_linear_ = false, is_matrix_ = false;
  std::array<std::array<float, 3>, 3> columns_{};
};

/// An OpenColorIO config, in this process. For its functions see ColorConfig.
class OcioConfig {
 public:
  static OcioConfig built_in();
  /// On damaged files anything may happen.
  static OcioConfig from_file(const std::filesystem::path& file, const std::string& rec709_name);

  const std::string& description() const;
  OcioTransform to_space(const std::string& space) const;
  OcioTransform from_space(const std::string& space) const;
  OcioTransform between(const std::string& from, const std::string& to) const;
  OcioTransform to_display(const std::string& space, const std::string& display,
                           const std::string& view) const;
  std::string interop_id(const std::string& space) const;
  std::string space_from_interop_id(std::string_view id) const;

 private:
  struct State;
  explicit OcioConfig(std::shared_ptr<const State> state) : state_(std::move(state)) {}
  std::shared_ptr<const State> state_;
};

}  // namespace raystage::compose
