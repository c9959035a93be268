// SPDX-License-Identifier: Apache-2.0
#include "base/module_file.h"

#include <gtest/gtest.h>

#include <string>

#include "base/error.h"

namespace raystage {
namespace {

TEST(ModuleFile, PathsAreRelativeToTheCommand) {
  const std::filesystem::path command = std::filesystem::read_symlink("/proc/self/exe");
  EXPECT_EQ(module_path("none.so"),
            command.parent_path().parent_path() / "lib" / "raystage" / "none.so");
}

TEST(ModuleFile, MissingModulesAreNamedWithTheirPurpose) {
  try {
    load_module("raystage-none.so", "entry", "nothing can be read");
    FAIL() << "a module that does not exist was loaded";
  } catch (const Error& error) {
    const std::string message = error.what();
    EXPECT_NE(message.find("nothing can be read"), std::string::npos) << message;
    EXPECT_NE(message.find("lib/raystage/raystage-none.so"), std::string::npos) << message;
    EXPECT_NE(message.find("Reinstall raystage"), std::string::npos) << message;
  }
}

}  // namespace
}  // namespace raystage
