"""The agents as processes: started, watched, fenced, ended."""
