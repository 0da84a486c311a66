#pragma once
namespace LAMMPS_NS { class LAMMPS; }

// The engine reads objects that the library allocated. If their size there differs from the size in the headers,
// every access would corrupt memory silently; so each is compared before the first deck line is read.
// Returns the name of the first class that differs, or null.
const char *library_mismatch(LAMMPS_NS::LAMMPS *lmp);
