// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace raystage::testing {

/// Returns the project's folder, from which the tests were built.
std::filesystem::path source_folder();

/// Returns the folder of the commands that were built with the tests.
std::filesystem::path commands_folder();

/// Returns the library of tests/end_to_end/disk_faults.cpp: commands that preload it have a faulty
/// disk.
std::filesystem::path disk_faults_library();

}  // namespace raystage::testing
