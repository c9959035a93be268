// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace raystage {

/// Returns the path of a program or module of lib/raystage: relative to the command, or to the
/// library that other programs link (lib/libraystage.so, lib/ARCHITECTURE/libraystage.so). If there
/// is none, that relative to the command.
std::filesystem::path module_path(const std::string& name);

/// Loads a module of lib/raystage, which stays loaded because it owns the code of its objects, and
/// returns the address of its C function `entry`. `purpose`: the start of the error, such as
/// "textures cannot be read". Throws Error (failed) that names the file if it or the function is
/// missing.
void* load_module(const std::string& name, const char* entry, const std::string& purpose);

}  // namespace raystage
