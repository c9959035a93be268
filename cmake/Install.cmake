# SPDX-License-Identifier: Apache-2.0
# Where files are installed. The layout is the same in the build folder and below any prefix.

include(GNUInstallDirs)

# Modules that executables load at run time, relative to the folder of the executables.
set(RAYSTAGE_MODULE_DIRECTORY "../lib/raystage")
