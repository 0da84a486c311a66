#pragma once
#include <memory>
#include <string>
#include <vector>

#include "base/fix_input.h"
#include "interfaces/agglomerates.h"
#include "interfaces/checkpointed.h"
#include "interfaces/energy_holder.h"
#include "fix_wall_gran.h"
#include "interfaces/free_flight_partners.h"
#include "contact/granular_contact.h"
#include "contact/plate_contact.h"

namespace LAMMPS_NS {

// What the walls of the deck have in common: the list of the sub-spheres near one, the stock wall of LIGGGHTS, which they
// lend to a contact law, and the work on the sub-spheres.
class FixWall : public FixWallGran, public Checkpointed, public EnergyHolder, public StockWall,
                public ActsInFreeFlight {
 public:
  // The arguments after `contact` are those of wall/gran.
  FixWall(class LAMMPS *, int narg, char **arg);

  int setmask() override;
  void init() override;
  void post_integrate() override;

 protected:
  std::unique_ptr<Agglomerates> agglomerates_;
  std::vector<NearSphere> near_;
  std::string own_style_;
  std::vector<double> work_on_stone_;  // of the wall so far, by agglomerate, J

  FixInput input() { return FixInput(lmp, this, own_style_); }
  static int position_of_contact(int narg, char **arg);
  void read_agglomerates(const std::string &file);
  void pre_force(int) override;
  virtual void list_near() = 0;  // for the stock wall and in near_: all that the wall could touch before the next build
  void take_list_of_stock_wall();
  void add_half_work();
  void save_wall(CheckpointWriter &, const std::string &work, const std::string &contacts) const;
  void restore_wall(const CheckpointReader &, const std::string &work, const std::string &contacts);

 private:
  int type() const override { return atom_type_wall_; }
  void act(int vflag) override { FixWallGran::post_force(vflag); }
  int history_size() const override { return dnum_; }
  double *history(int i) override;
};

}  // namespace LAMMPS_NS
