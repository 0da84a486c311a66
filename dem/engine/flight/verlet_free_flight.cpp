#include "flight/verlet_free_flight.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "base/fixes.h"
#include "force.h"
#include "neighbor.h"
#include "output.h"
#include "pair.h"
#include "signal_handling.h"
#include "timer.h"
#include "update.h"

using namespace LAMMPS_NS;

void VerletFreeFlight::init() {
  Verlet::init();
  flight_ = fix_that_is<FlightControl>(modify);
  lists_.init(fix_that_is<BodyMaker>(modify), flight_ ? flight_->body_skin() : 0);
}

void VerletFreeFlight::setup() {
  Verlet::setup();
  if (flight_) flight_->hide();  // what a resumed run shows to the first dump
}

void VerletFreeFlight::run(int steps) {
  const bigint last = update->ntimestep + steps;
  while (update->ntimestep < last) {
    if (flight_) flight_->jump();
    step();
    if (SignalHandler::request_quit && !SignalHandler::request_write_restart) break;
  }
  if (flight_) flight_->bring_back();
}

// One step, in the order of Verlet::run.
void VerletFreeFlight::step() {
  const bigint now = ++update->ntimestep;
  ev_set(now);
  if (modify->n_pre_initial_integrate) modify->pre_initial_integrate();
  modify->initial_integrate(vflag);
  if (modify->n_post_integrate) modify->post_integrate();

  if (lists_.must_build()) {
    rebuild();
  } else {
    comm->forward_comm();
    if (flight_ && flight_->holds_others()) modify->pre_neighbor();  // the lists of neighbours stay as they are
  }

  force_clear();
  if (modify->n_pre_force) modify->pre_force(vflag);
  timer->stamp();
  if (pair_compute_flag) force->pair->compute(eflag, vflag);
  timer->stamp(TIME_PAIR);

  if (modify->n_post_force) modify->post_force(vflag);
  if (modify->n_pre_final_integrate) modify->pre_final_integrate();
  modify->final_integrate();
  if (modify->n_end_of_step) modify->end_of_step();

  if (now != output->next) return;
  timer->stamp();
  if (flight_) flight_->show();
  output->write(now);
  if (flight_) flight_->hide();
  timer->stamp(TIME_OUTPUT);
}

void VerletFreeFlight::rebuild() {
  if (modify->n_pre_exchange) modify->pre_exchange();
  if (flight_) flight_->change_arrays();
  domain->pbc();
  if (domain->box_change) {
    domain->reset_box();
    comm->setup();
    if (neighbor->style) neighbor->setup_bins();
  }
  timer->stamp();
  comm->exchange();
  if (atom->sortfreq > 0 && update->ntimestep >= atom->nextsort) atom->sort();
  comm->borders();
  timer->stamp(TIME_COMM);
  if (modify->n_pre_neighbor) modify->pre_neighbor();
  lists_.build();
  timer->stamp(TIME_NEIGHBOR);
}
