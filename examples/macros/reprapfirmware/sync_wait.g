; M98 P"sync_wait.g" H2 C7: waits until head 2 has given seven signals. G4 lets moves above run out.
while global.given[param.H] < param.C
  G4 P10
